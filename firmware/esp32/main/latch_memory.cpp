#include "latch_memory.hpp"

#include <string.h>

#include <algorithm>
#include <atomic>

#include "esp_attr.h"

namespace wheelwire {
namespace {

constexpr size_t kRecords = 2;

RTC_NOINIT_ATTR uint8_t records[kRecords][Latches::kSize];

}  // namespace

size_t RtcLatchMemory::load(uint8_t* out, size_t capacity) {
  for (const auto& record : records) {
    Latches latches;
    if (!Latches::decode(record, sizeof record, latches)) continue;
    memcpy(out, record, std::min(capacity, sizeof record));
    return sizeof record;
  }
  return 0;
}

void RtcLatchMemory::save(const uint8_t* data, size_t size) {
  for (auto& record : records) {
    memcpy(record, data, std::min(size, sizeof record));
    // The compiler must not write both at once.
    std::atomic_signal_fence(std::memory_order_seq_cst);
  }
}

}  // namespace wheelwire
