#include "latch_memory.hpp"

#include <algorithm>
#include <vector>

#include "check.hpp"
#include "esp_attr.h"

using namespace wheelwire;

namespace {

using Bytes = std::vector<uint8_t>;

constexpr Latches kEstop{.estop = true, .faults = 0};
constexpr Latches kFault{.estop = false, .holds = true, .faults = 0x15};

/// The chip's memory that no start-up code touches.
Bytes rtc_memory() { return {__start_fake_rtc_noinit, __stop_fake_rtc_noinit}; }
void set_rtc_memory(const Bytes& bytes) {
  std::copy(bytes.begin(), bytes.end(), __start_fake_rtc_noinit);
}
void lose_rtc_memory(uint8_t content) { set_rtc_memory(Bytes(rtc_memory().size(), content)); }
void lose_main_memory(uint8_t content) {
  std::fill(__start_fake_noinit, __stop_fake_noinit, content);
}

void save(const Latches& latches) {
  uint8_t record[Latches::kSize];
  latches.encode(record);
  RtcLatchMemory{}.save(record, sizeof record);
}

/// What is found after a reset; false: nothing is known.
bool load(Latches& latches) {
  uint8_t record[Latches::kSize];
  const size_t size = RtcLatchMemory{}.load(record, sizeof record);
  return size != 0 && Latches::decode(record, size, latches);
}

}  // namespace

TEST(a_reset_that_takes_one_memory_leaves_the_latches_and_after_a_power_on_nothing_is_known) {
  for (const uint8_t content : {uint8_t{0x00}, uint8_t{0x5a}, uint8_t{0xff}}) {
    Latches found;
    save(kEstop);
    lose_rtc_memory(content);
    lose_main_memory(content);
    CHECK(!load(found));
    save(kFault);
    lose_rtc_memory(content);
    CHECK(load(found) && found == kFault);
    save(kEstop);
    lose_main_memory(content);
    CHECK(load(found) && found == kEstop);
  }
}

TEST(one_damaged_record_is_no_loss_and_two_are_not_believed) {
  save(kEstop);
  lose_main_memory(0);
  const Bytes good = rtc_memory();
  CHECK(good.size() == 2 * Latches::kSize);
  Latches found;
  for (size_t bit = 0; bit < 8 * good.size(); ++bit) {
    Bytes damaged = good;
    damaged[bit / 8] = static_cast<uint8_t>(damaged[bit / 8] ^ 1 << bit % 8);
    set_rtc_memory(damaged);
    CHECK(load(found) && found == kEstop);
    const size_t other = (bit / 8 + Latches::kSize) % damaged.size();
    damaged[other] = static_cast<uint8_t>(damaged[other] ^ 1 << bit % 8);
    set_rtc_memory(damaged);
    CHECK(!load(found));
  }
}

TEST(a_reset_amid_a_save_leaves_what_was_before_or_after) {
  save(kFault);
  const Bytes before = rtc_memory();
  save(kEstop);
  const Bytes after = rtc_memory();
  for (size_t written = 0; written <= after.size(); ++written) {
    Bytes torn = before;
    std::copy_n(after.begin(), written, torn.begin());
    set_rtc_memory(torn);
    Latches found;
    CHECK(load(found) && (found == kFault || found == kEstop));
  }
}
