#include "latch_memory.hpp"

#include <string.h>

#include <algorithm>
#include <atomic>

#include "esp_attr.h"

namespace wheelwire {
namespace {

constexpr size_t kRecords = 2;

using Record = uint8_t[Latches::kSize];

RTC_NOINIT_ATTR Record records[kRecords];
/// For a reset that takes the RTC memory with it.
__NOINIT_ATTR Record spare;

bool is_whole(const Record& record) {
  Latches latches;
  return Latches::decode(record, sizeof record, latches);
}

void write(Record& record, const uint8_t* data, size_t size) {
  memcpy(record, data, std::min(size, sizeof record));
  // The compiler must not write two at once.
  std::atomic_signal_fence(std::memory_order_seq_cst);
}

}  // namespace

size_t RtcLatchMemory::load(uint8_t* out, size_t capacity) {
  for (const Record* const record : {&records[0], &records[1], &spare}) {
    if (!is_whole(*record)) continue;
    memcpy(out, *record, std::min(capacity, sizeof *record));
    return sizeof *record;
  }
  return 0;
}

void RtcLatchMemory::save(const uint8_t* data, size_t size) {
  for (Record* const record : {&records[0], &records[1], &spare}) write(*record, data, size);
}

}  // namespace wheelwire
