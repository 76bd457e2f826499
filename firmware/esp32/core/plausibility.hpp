// The duty that a speed can need: the limit of the output, and the measure of a wheel whose encoder
// loses edges. Such a wheel seems slow, so the loop drives it harder than its speed explains.
#pragma once

#include <stdint.h>

#include "controller.hpp"

namespace wheelwire {

struct Supply {
  int32_t nominal_mv;     ///< Behind the bridge, where the feed-forward holds.
  int32_t drop_mv;        ///< Lost in the bridge.
  int32_t unmeasured_mv;  ///< Of the battery, taken for granted where it is not measured.
};

/// Supply behind the bridge at which the feed-forward holds, over the one that there is, x 4096.
int32_t supply_ratio_q12(uint16_t battery_mv, const Supply& supply);

/// What a load may need at a constant speed; `margin_q15` beyond the feed-forward.
int32_t duty_for(int32_t speed_umps, int32_t margin_q15, int32_t supply_q12,
                 const ControllerGains& gains);

/// As much as a setpoint allows, its change included.
int32_t duty_limit(int32_t target_umps, int32_t change_umps, int32_t supply_q12,
                   const ControllerGains& gains);

class PlausibilityMonitor {
 public:
  /// Call at every control step with the duty that was on the output since the last one. True when
  /// it has been more than the speed and its growth can need, for long enough.
  bool update(int32_t duty_q15, int32_t measured_umps, bool ticked, int32_t supply_q12,
              uint32_t period_us, uint32_t time_us, const ControllerGains& gains);
  void reset();

 private:
  int32_t slow_umps_q4_ = 0;  // The speed, low-pass filtered.
  uint32_t silence_us_ = 0;
  uint32_t excess_us_ = 0;
};

}  // namespace wheelwire
