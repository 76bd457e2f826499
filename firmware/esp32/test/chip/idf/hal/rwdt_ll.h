// The registers of the RTC watchdog. Each access is one of the bus, before which the other core may
// do something; a write while they are protected changes nothing.
#pragma once

#include <stdint.h>

#include <functional>
#include <utility>

#include "esp_timer.h"
#include "hal/wdt_types.h"

struct rwdt_dev_t {
  /// The slow clock: what the watchdog counts. Nominally 150 kHz.
  double clock_hz = 150'000;
  bool is_writable = false;
  bool is_enabled = false;
  struct {
    wdt_stage_action_t action = WDT_STAGE_ACTION_OFF;
    uint32_t ticks = 0;
  } stages[4];
  int64_t fed_us = 0;
  /// What the other core does before an access.
  std::function<void()> on_access;

  void write(auto change) {
    if (on_access) {
      // What it does is itself not disturbed.
      const std::function<void()> other = std::exchange(on_access, nullptr);
      other();
      if (!on_access) on_access = other;
    }
    change();
  }
  void write_protected(auto change) {
    write([&] {
      if (is_writable) change();
    });
  }

  struct Expiry {
    wdt_stage_action_t action;
    int64_t at_us;  ///< Of the test's clock.
  };
  /// What the stage does, and when, unless the watchdog is fed. The stages run one after the other.
  Expiry expiry(wdt_stage_t stage) const {
    if (!is_enabled) return {WDT_STAGE_ACTION_OFF, INT64_MAX};
    double at_us = static_cast<double>(fed_us);
    for (int i = 0; i <= stage; ++i) at_us += stages[i].ticks / clock_hz * 1e6;
    return {stages[stage].action, static_cast<int64_t>(at_us)};
  }
};

inline rwdt_dev_t fake_rwdt;

#define RWDT_DEV_GET() (&fake_rwdt)

inline void rwdt_ll_write_protect_disable(rwdt_dev_t* device) {
  device->write([&] { device->is_writable = true; });
}
inline void rwdt_ll_write_protect_enable(rwdt_dev_t* device) {
  device->write([&] { device->is_writable = false; });
}
inline void rwdt_ll_enable(rwdt_dev_t* device) {
  device->write_protected([&] { device->is_enabled = true; });
}
inline void rwdt_ll_disable(rwdt_dev_t* device) {
  device->write_protected([&] { device->is_enabled = false; });
}
inline void rwdt_ll_feed(rwdt_dev_t* device) {
  device->write_protected([&] { device->fed_us = fake_time_us; });
}
inline void rwdt_ll_config_stage(rwdt_dev_t* device, wdt_stage_t stage, uint32_t ticks,
                                 wdt_stage_action_t action) {
  device->write_protected([&] { device->stages[stage].action = action; });
  device->write_protected([&] { device->stages[stage].ticks = ticks; });
}
inline void rwdt_ll_disable_stage(rwdt_dev_t* device, wdt_stage_t stage) {
  device->write_protected([&] { device->stages[stage].action = WDT_STAGE_ACTION_OFF; });
}
