// ESP-IDF's driver of the RTC watchdog: its functions are in RAM only if the configuration says so.
#pragma once

#include "hal/rwdt_ll.h"

enum wdt_inst_t { WDT_MWDT0, WDT_MWDT1, WDT_RWDT };
struct wdt_hal_context_t {
  rwdt_dev_t* device;
};

inline void wdt_hal_write_protect_disable(wdt_hal_context_t* watchdog) {
  rwdt_ll_write_protect_disable(watchdog->device);
}
inline void wdt_hal_write_protect_enable(wdt_hal_context_t* watchdog) {
  rwdt_ll_write_protect_enable(watchdog->device);
}
inline void wdt_hal_config_stage(wdt_hal_context_t* watchdog, wdt_stage_t stage, uint32_t ticks,
                                 wdt_stage_action_t action) {
  rwdt_ll_config_stage(watchdog->device, stage, ticks, action);
}
inline void wdt_hal_enable(wdt_hal_context_t* watchdog) {
  rwdt_ll_feed(watchdog->device);
  rwdt_ll_enable(watchdog->device);
}
inline void wdt_hal_init(wdt_hal_context_t* watchdog, wdt_inst_t, uint32_t, bool) {
  watchdog->device = RWDT_DEV_GET();
  wdt_hal_write_protect_disable(watchdog);
  rwdt_ll_disable(watchdog->device);
  for (const wdt_stage_t stage : {WDT_STAGE0, WDT_STAGE1, WDT_STAGE2, WDT_STAGE3})
    rwdt_ll_disable_stage(watchdog->device, stage);
  wdt_hal_write_protect_enable(watchdog);
}

/// What esp_panic_handler_enable_rtc_wdt() of ESP-IDF 5.5.3 does.
inline void fake_panic_arms_watchdog() {
  wdt_hal_context_t watchdog;
  wdt_hal_init(&watchdog, WDT_RWDT, 0, false);
  wdt_hal_write_protect_disable(&watchdog);
  wdt_hal_config_stage(&watchdog, WDT_STAGE0, 1'500'000, WDT_STAGE_ACTION_RESET_RTC);
  wdt_hal_enable(&watchdog);
  wdt_hal_write_protect_enable(&watchdog);
}
