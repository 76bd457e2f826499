// The slow clock as the start-up measured it.
#pragma once

#include <stdint.h>

#include "soc/rtc.h"

/// What it measured; a clock drifts afterwards.
inline double fake_measured_hz = 150'000;

/// Microseconds per period, as a fixed-point number.
inline uint32_t esp_clk_slowclk_cal_get() {
  return static_cast<uint32_t>(1e6 / fake_measured_hz * (1 << RTC_CLK_CAL_FRACT));
}
