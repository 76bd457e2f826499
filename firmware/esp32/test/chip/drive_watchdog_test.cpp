// The watchdog of a drive and of a panic, with two cores that use it at the same time.
#include "drive_watchdog.hpp"

#include <algorithm>
#include <functional>
#include <semaphore>
#include <thread>
#include <vector>

#include "esp_attr.h"
#include "esp_private/esp_clk.h"
#include "esp_rom_sys.h"
#include "hal/wdt_hal.h"
#include "started_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

extern "C" void __wrap_panicHandler(void* frame);
extern "C" void __wrap_xt_unhandled_exception(void* frame);

namespace {

/// What the handler of ESP-IDF does in a test, and whether it was entered.
std::function<void(void*)> idf_handler;

}  // namespace

extern "C" void __real_panicHandler(void* frame) { idf_handler(frame); }
extern "C" void __real_xt_unhandled_exception(void* frame) { idf_handler(frame); }

namespace {

constexpr int64_t kSecondUs = 1'000'000;
constexpr int64_t kPanicUs = 10 * kSecondUs;
constexpr double kDrift = 0.11;  ///< Of the slow clock, since it was measured.

void (*const kHandlers[])(void*) = {__wrap_panicHandler, __wrap_xt_unhandled_exception};

/// A reset: memory as start-up code sets it up, registers as a power-on leaves them.
void reset_chip() {
  static const std::vector<uint8_t> initial(__start_fake_dram, __stop_fake_dram);
  std::copy(initial.begin(), initial.end(), __start_fake_dram);
  fake_rwdt = {};
  fake_matrix = {};
  fake_on_delay = nullptr;
  idf_handler = [](void*) {};
  fake_time_us += kSecondUs;
}

void drive_for_ms(int steps) {
  for (int i = 0; i < steps; ++i) {
    fake_time_us += 1000;
    feed_drive_watchdog();
  }
}

int64_t from_now(const rwdt_dev_t::Expiry& expiry) { return expiry.at_us - fake_time_us; }

/// Whether the chip is reset about ten seconds after `since_us`, and by nothing sooner.
bool is_guarded(int64_t since_us) {
  const rwdt_dev_t::Expiry first = fake_rwdt.expiry(WDT_STAGE0);
  const int64_t after_us = first.at_us - since_us;
  return first.action == WDT_STAGE_ACTION_RESET_RTC && after_us > kPanicUs * 9 / 10 &&
         after_us < kPanicUs * 12 / 10;
}

}  // namespace

TEST(a_drive_that_is_not_fed_ends_in_a_reset_within_20_ms_and_in_a_second_one) {
  for (const double drift : {-kDrift, 0.0, kDrift}) {
    reset_chip();
    fake_measured_hz = 136'000;
    fake_rwdt.clock_hz = fake_measured_hz / (1 + drift);
    prepare_drive_watchdog();
    CHECK(fake_rwdt.expiry(WDT_STAGE0).action == WDT_STAGE_ACTION_OFF);
    for (int i = 0; i < 3000; ++i) {
      drive_for_ms(1);
      CHECK(from_now(fake_rwdt.expiry(WDT_STAGE0)) > 15'900);
    }
    const rwdt_dev_t::Expiry first = fake_rwdt.expiry(WDT_STAGE0);
    CHECK(first.action == WDT_STAGE_ACTION_RESET_SYSTEM && from_now(first) < 20'000);
    const rwdt_dev_t::Expiry second = fake_rwdt.expiry(WDT_STAGE1);
    CHECK(second.action == WDT_STAGE_ACTION_RESET_RTC);
    CHECK(second.at_us - first.at_us > kSecondUs * 8 / 10);
    CHECK(second.at_us - first.at_us < kSecondUs * 12 / 10);
  }
  fake_measured_hz = 150'000;
}

TEST(what_does_not_drive_is_not_watched_until_it_drives_again) {
  reset_chip();
  prepare_drive_watchdog();
  drive_for_ms(10);
  disarm_drive_watchdog();
  CHECK(fake_rwdt.expiry(WDT_STAGE0).action == WDT_STAGE_ACTION_OFF);
  fake_time_us += kSecondUs;
  drive_for_ms(1);
  CHECK(fake_rwdt.expiry(WDT_STAGE0).action == WDT_STAGE_ACTION_RESET_SYSTEM);
  CHECK(!fake_rwdt.is_writable);
}

TEST(a_panic_first_releases_the_motors_then_arms_its_watchdog_then_calls_the_handler) {
  for (void (*const handler)(void*) : kHandlers) {
    on_every_stage([&](const BoardDescription& board) {
      reset_chip();
      StartedRobot robot(board);
      prepare_drive_watchdog();
      for (int i = 0; i < 2; ++i) robot.left_motor.drive(20'000);
      drive_for_ms(1);
      CHECK(drives(board));
      fake_rwdt.on_access = [&] { CHECK(!drives(board)); };
      int frame = 0;
      int entries = 0;
      idf_handler = [&](void* given) {
        ++entries;
        CHECK(given == &frame && is_guarded(fake_time_us) && !drives(board));
      };
      handler(&frame);
      CHECK(entries == 1);
      // Nothing is left of the stages before.
      for (const wdt_stage_t later : {WDT_STAGE1, WDT_STAGE2, WDT_STAGE3})
        CHECK(fake_rwdt.stages[later].action == WDT_STAGE_ACTION_OFF);
    });
  }
}

TEST(a_panic_before_the_clock_is_known_is_guarded) {
  for (const double clock_hz : {136'000.0, 150'000.0}) {
    reset_chip();
    fake_rwdt.clock_hz = clock_hz;
    __wrap_xt_unhandled_exception(nullptr);
    CHECK(is_guarded(fake_time_us));
  }
}

TEST(a_handler_that_panics_again_and_again_does_not_feed_its_watchdog) {
  reset_chip();
  prepare_drive_watchdog();
  __wrap_xt_unhandled_exception(nullptr);
  const int64_t start_us = fake_time_us;
  for (int i = 0; i < 9; ++i) {
    fake_time_us += kSecondUs;
    __wrap_panicHandler(nullptr);
    CHECK(is_guarded(start_us));
  }
}

TEST(the_other_core_ends_no_guard_of_a_panic) {
  // While the handler of one core runs, up to the stall, the other one goes on: it drives, stops,
  // or its dead-man fires. ESP-IDF's handler arms the watchdog once more.
  for (void (*const other_core)() : {feed_drive_watchdog, disarm_drive_watchdog}) {
    for (const bool idf_arms : {false, true}) {
      reset_chip();
      prepare_drive_watchdog();
      drive_for_ms(1);
      idf_handler = [&](void*) {
        if (idf_arms) fake_panic_arms_watchdog();
        other_core();
      };
      // Before each access of the handler, too.
      fake_rwdt.on_access = other_core;
      __wrap_panicHandler(nullptr);
      fake_rwdt.on_access = nullptr;
      CHECK(is_guarded(fake_time_us));
    }
  }
}

TEST(what_the_other_core_has_begun_ends_no_guard_either) {
  for (void (*const other_core)() : {feed_drive_watchdog, disarm_drive_watchdog}) {
    for (int begun = 0; begun < 5; ++begun) {
      reset_chip();
      prepare_drive_watchdog();
      drive_for_ms(1);
      std::binary_semaphore stands{0};
      std::binary_semaphore goes_on{0};
      std::binary_semaphore is_done{0};
      int accesses = 0;
      fake_rwdt.on_access = [&] {
        if (accesses++ != begun) return;
        stands.release();
        goes_on.acquire();
      };
      std::thread other([&] {
        other_core();
        if (accesses <= begun) stands.release();
        is_done.release();
      });
      stands.acquire();
      // It gets on while the panicking core releases the motors and waits.
      fake_on_delay = [&](uint32_t) {
        goes_on.release();
        is_done.acquire();
      };
      __wrap_xt_unhandled_exception(nullptr);
      other.join();
      CHECK(is_guarded(fake_time_us) && !fake_rwdt.is_writable);
    }
  }
  reset_chip();
}
