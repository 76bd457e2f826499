// How much duty a speed can need. This limits the output, and reveals an encoder that loses edges:
// its wheel seems slow, so the loop drives it harder than the measured speed explains.
#pragma once

#include <stdint.h>

#include "controller.hpp"

namespace wheelwire {

struct Supply {
  int32_t nominal_mv;     ///< Behind the bridge, where the feed-forward holds.
  int32_t drop_mv;        ///< Lost in the bridge.
  int32_t unmeasured_mv;  ///< Battery voltage assumed where it is not measured.
};

/// Nominal over present supply behind the bridge, x 4096.
int32_t supply_ratio_q12(uint16_t battery_mv, const Supply& supply);

/// The most that a load can need at constant speed: `margin_q15` beyond the feed-forward.
int32_t duty_for(int32_t speed_umps, int32_t margin_q15, int32_t supply_q12,
                 const ControllerGains& gains);

/// The output's limit at a setpoint, with what its change needs.
int32_t duty_limit(int32_t target_umps, int32_t change_umps, int32_t supply_q12,
                   const ControllerGains& gains);

class PlausibilityMonitor {
 public:
  /// Call at every control step with the duty that was on the output since the last one. True once
  /// it has exceeded what the speed and its growth can need for `time_us`.
  bool update(int32_t duty_q15, int32_t measured_umps, bool ticked, int32_t supply_q12,
              uint32_t period_us, uint32_t time_us, const ControllerGains& gains);
  void reset();

 private:
  int32_t slow_umps_q4_ = 0;  // The speed, low-pass filtered.
  uint32_t silence_us_ = 0;
  uint32_t excess_us_ = 0;
};

}  // namespace wheelwire
