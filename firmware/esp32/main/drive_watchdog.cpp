#include "drive_watchdog.hpp"

#include "esp_attr.h"
#include "esp_private/esp_clk.h"
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

}  // namespace

void prepare_drive_watchdog() {
  // In periods of the slow clock as measured at start-up: its oscillator is imprecise.
  const auto ticks =
      static_cast<uint32_t>((kLimitUs << RTC_CLK_CAL_FRACT) / esp_clk_slowclk_cal_get());
  wdt_hal_context_t watchdog;
  wdt_hal_init(&watchdog, WDT_RWDT, 0, false);
  wdt_hal_write_protect_disable(&watchdog);
  wdt_hal_config_stage(&watchdog, WDT_STAGE0, ticks, WDT_STAGE_ACTION_RESET_SYSTEM);
  wdt_hal_write_protect_enable(&watchdog);
}

// The other functions inline their register accesses: they also run while flash is inaccessible.

void feed_drive_watchdog() {
  rwdt_dev_t* const device = RWDT_DEV_GET();
  rwdt_ll_write_protect_disable(device);
  rwdt_ll_feed(device);
  rwdt_ll_enable(device);
  rwdt_ll_write_protect_enable(device);
}

IRAM_ATTR void disarm_drive_watchdog() {
  rwdt_dev_t* const device = RWDT_DEV_GET();
  rwdt_ll_write_protect_disable(device);
  rwdt_ll_disable(device);
  rwdt_ll_write_protect_enable(device);
}

}  // namespace wheelwire
