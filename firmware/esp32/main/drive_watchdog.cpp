#include "drive_watchdog.hpp"

#include <atomic>

#include "esp_attr.h"
#include "esp_private/esp_clk.h"
#include "esp_rom_sys.h"
#include "hal/rwdt_ll.h"
#include "hal/wdt_hal.h"
#include "soc/rtc.h"
#include "step_watch.hpp"

namespace wheelwire {
namespace {

/// Within 20 ms of the last control step even if the watchdog's clock runs 11 % slow, and later
/// than the dead-man, after which a core dump can still be written.
constexpr uint64_t kLimitUs = 18'000;
static_assert(kLimitUs > kMaxWatchUs && kLimitUs * 111 / 100 < 20'000);

/// From the first reset to the second one. The bootloader, which gives the watchdog its own limit
/// of 9 s, starts within some tens of milliseconds.
constexpr uint64_t kSecondLimitUs = 1'000'000;

/// As long as ESP-IDF gives its own handler, with the core dump: esp_panic_handler_enable_rtc_wdt()
/// in v5.5.3, components/esp_system/panic.c.
constexpr uint64_t kPanicLimitUs = 10'000'000;

/// For a panic before the clock is known: its nominal frequency on an ESP32. The clocks of the
/// other chips are slower by a tenth.
constexpr uint64_t kNominalHz = 150'000;
DRAM_ATTR uint32_t panic_ticks = kPanicLimitUs * kNominalHz / 1'000'000;

DRAM_ATTR std::atomic<bool> panics{false};

/// Periods of the slow clock as measured at start-up: its oscillator is imprecise.
uint32_t ticks_of(uint64_t us) {
  return static_cast<uint32_t>((us << RTC_CLK_CAL_FRACT) / esp_clk_slowclk_cal_get());
}

}  // namespace

void prepare_drive_watchdog() {
  panic_ticks = ticks_of(kPanicLimitUs);
  wdt_hal_context_t watchdog;
  wdt_hal_init(&watchdog, WDT_RWDT, 0, false);
  wdt_hal_write_protect_disable(&watchdog);
  wdt_hal_config_stage(&watchdog, WDT_STAGE0, ticks_of(kLimitUs), WDT_STAGE_ACTION_RESET_SYSTEM);
  // The first stage resets neither the watchdog nor a core's stall, because esp_cpu_stall() writes
  // RTC registers. The second stage resets those, too.
  wdt_hal_config_stage(&watchdog, WDT_STAGE1, ticks_of(kSecondLimitUs), WDT_STAGE_ACTION_RESET_RTC);
  wdt_hal_write_protect_enable(&watchdog);
}

// The other functions inline their register accesses: they also run while flash is inaccessible.

void feed_drive_watchdog() {
  if (panics.load(std::memory_order_relaxed)) return;
  rwdt_dev_t* const device = RWDT_DEV_GET();
  rwdt_ll_write_protect_disable(device);
  rwdt_ll_feed(device);
  rwdt_ll_enable(device);
  rwdt_ll_write_protect_enable(device);
}

IRAM_ATTR void disarm_drive_watchdog() {
  if (panics.load(std::memory_order_relaxed)) return;
  rwdt_dev_t* const device = RWDT_DEV_GET();
  rwdt_ll_write_protect_disable(device);
  rwdt_ll_disable(device);
  rwdt_ll_write_protect_enable(device);
}

IRAM_ATTR void guard_panic() {
  // Once: a handler that panics itself, again and again, must not feed its watchdog.
  if (panics.load(std::memory_order_relaxed)) return;
  panics.store(true);
  // The other core may be in the middle of one of the functions above: it is done by then, and
  // begins none any more. (esp_rom_delay_us() is in ROM.)
  esp_rom_delay_us(2);
  rwdt_dev_t* const device = RWDT_DEV_GET();
  rwdt_ll_write_protect_disable(device);
  rwdt_ll_config_stage(device, WDT_STAGE0, panic_ticks, WDT_STAGE_ACTION_RESET_RTC);
  rwdt_ll_disable_stage(device, WDT_STAGE1);
  rwdt_ll_feed(device);
  rwdt_ll_enable(device);
  rwdt_ll_write_protect_enable(device);
}

}  // namespace wheelwire
