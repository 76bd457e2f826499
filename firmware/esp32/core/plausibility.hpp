// How much duty a speed can need. This limits the output, and reveals an encoder that loses edges:
// its wheel seems slow, so the loop drives it harder than the measured speed explains.
#pragma once

#include <stdint.h>

#include "controller.hpp"
#include "evidence.hpp"

namespace wheelwire {

struct Supply {
  int32_t nominal_mv;     ///< Behind the bridge, where the feed-forward holds.
  int32_t drop_mv;        ///< Lost in the bridge.
  int32_t unmeasured_mv;  ///< Battery voltage assumed where it is not measured.
};

/// Nominal over present supply behind the bridge, x 4096.
int32_t supply_ratio_q12(uint16_t battery_mv, const Supply& supply);

/// The most that a load can need at constant speed: `margin_q15` beyond the feed-forward.
inline int32_t duty_for(int32_t speed_umps, int32_t margin_q15, int32_t supply_q12,
                        const ControllerGains& gains) {
  const int32_t moving_q15 = scale(gains.feedforward_q24, magnitude(speed_umps), 24);
  return scale(moving_q15 + gains.static_q15 + margin_q15, supply_q12, 12);
}

/// The output's limit at a constant setpoint.
int32_t duty_limit(int32_t target_umps, int32_t supply_q12, const ControllerGains& gains);

/// That limit with what a change of the setpoint needs, per control step.
int32_t while_accelerating(int32_t limit_q15, int32_t change_umps, const ControllerGains& gains);

class PlausibilityMonitor {
 public:
  /// Call at every control step with the duty that was on the output since the last one. True once
  /// it has exceeded what the speed and its growth can need for `time_us`.
  bool update(int32_t duty_q15, int32_t measured_umps, bool ticked, int32_t supply_q12,
              uint32_t period_us, uint32_t time_us, const ControllerGains& gains);
  /// Call it instead while no loop drives the wheel: what it did before is not forgotten.
  void rest(uint32_t period_us) {
    slow_umps_q4_ = 0;
    silence_us_ = 0;
    excess_.leak(period_us);
  }
  /// Somebody has cleared the fault, or what seemed to be one was none.
  void end_evidence() { excess_.end(); }

 private:
  bool lasts(int32_t excess_q15, int32_t gain_q4, int32_t speed_umps, int32_t slow_q4,
             int32_t supply_q12, uint32_t period_us, uint32_t time_us, const ControllerGains&);
  bool gains_speed_like_a_heavy_robot(int32_t excess_q15, int32_t speed_umps, int32_t slow_q4,
                                      int32_t supply_q12, uint32_t time_us, const ControllerGains&);
  void begin_anew(int32_t slow_q4, uint32_t time_us);

  int32_t slow_umps_q4_ = 0;  // The speed, low-pass filtered.
  uint32_t silence_us_ = 0;
  Evidence excess_;
  // While there is excess: the speed in the direction of the drive, low-pass filtered again, and
  // the sum of the recent excess.
  int32_t earlier_q4_ = 0;
  int64_t impulse_q15_ = 0;
};

}  // namespace wheelwire
