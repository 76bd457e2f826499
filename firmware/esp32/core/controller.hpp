// One wheel's velocity loop: feed-forward, and a PI controller for the rest.
#pragma once

#include "gains.hpp"
#include "plausibility.hpp"

namespace wheelwire {

/// Undoes the windup of a blocked wheel. While the wheel is held, the integral grows to a value
/// that would throw it forward on release. A released wheel gains speed faster than the slew limit
/// lets any setpoint do, which a wheel under a heavy load does not: then the integral returns to
/// its average from before, when the wheel was rolling.
class ObstacleMemory {
 public:
  /// Call once per control step. Returns the integral to continue with.
  int64_t update(int64_t integral_q32, int32_t target_umps, int32_t error_umps,
                 const ControllerGains& gains) {
    const int32_t target = magnitude(target_umps);
    const int32_t lag_umps = target_umps < 0 ? -error_umps : error_umps;
    const bool stalled = lag_umps > target - target / 4;
    if (!held_) {
      const int32_t required_steps = 1 << gains.memory_shift;
      if (stalled) {
        // Only a wheel that followed its setpoint for a while has an average to return to.
        held_ = rolled_steps_ == required_steps;
      } else {
        rolling_q32_ += (integral_q32 - rolling_q32_) >> gains.memory_shift;
        if (lag_umps < target / 4 && rolled_steps_ < required_steps) ++rolled_steps_;
      }
      return integral_q32;
    }
    if (stalled) {
      gain_umps_ = 0;
      return integral_q32;
    }
    if (lag_umps > target / 2) {
      gain_umps_ += gains.slew_umps;
      return integral_q32;
    }
    const bool released = gain_umps_ < target / 4;
    held_ = false;
    rolled_steps_ = 0;
    return released ? rolling_q32_ : integral_q32;
  }
  void reset() { *this = {}; }
  /// Call when a wheel that stands is to go the other way: what it built up against an obstacle
  /// does not count there. Returns the integral to continue with.
  int64_t turn_back() {
    held_ = false;
    rolled_steps_ = 0;
    return rolling_q32_;
  }

 private:
  bool held_ = false;
  int32_t rolled_steps_ = 0;
  int32_t gain_umps_ = 0;  // How far a setpoint could have slewed since the wheel moved again.
  int64_t rolling_q32_ = 0;
};

class Controller {
 public:
  /// Call once per control step with how much slower the wheel is than commanded. Returns the
  /// duty, q15.
  int32_t update(int32_t target_umps, int32_t error_umps, int32_t supply_q12,
                 const ControllerGains& gains) {
    const int32_t change = saturate32(static_cast<int64_t>(target_umps) - last_target_umps_);
    last_target_umps_ = target_umps;
    steady_limit_q15_ = duty_limit(target_umps, supply_q12, gains);
    const int32_t limit_q15 = while_accelerating(steady_limit_q15_, change, gains);
    const int64_t limit_q32 = static_cast<int64_t>(limit_q15) << 32;
    int64_t sum = sign(target_umps) * gains.static_q15;
    sum += multiply_shift(gains.feedforward_q24, target_umps, 24);
    sum += multiply_shift(gains.acceleration_q24, change, 24);
    sum += multiply_shift(gains.proportional_q24, error_umps, 24);
    sum += integral_q32_ >> 32;
    const int32_t wanted = saturate32(sum);
    const int32_t duty = clamp(wanted, -limit_q15, limit_q15);
    // Anti-windup: while the output is limited, integrate only away from the limit.
    saturated_ = wanted != duty;
    if (saturated_) ++saturated_steps_;
    if (!saturated_ || sign(error_umps) != sign(wanted)) {
      const int64_t step_q32 = static_cast<int64_t>(gains.integral_q32) * error_umps;
      integral_q32_ = clamp(integral_q32_ + step_q32, -limit_q32, limit_q32);
    }
    integral_q32_ = obstacle_.update(integral_q32_, target_umps, error_umps, gains);
    return duty;
  }
  /// Clears the integral; the wheel moves at `measured_umps`.
  void reset(int32_t measured_umps) {
    integral_q32_ = 0;
    last_target_umps_ = measured_umps;
    saturated_ = false;
    obstacle_.reset();
  }
  /// Call when a standing wheel is to go the other way. Otherwise the loop would drive it the old
  /// way until the integral is undone. At a low speed that takes seconds, and delays detection of a
  /// wheel fault by as much.
  void turn_back() { integral_q32_ = obstacle_.turn_back(); }
  /// The limit of the last step's output, without what a change of the target adds to it.
  int32_t steady_limit_q15() const { return steady_limit_q15_; }
  /// Control steps in which the output was limited. Wraps.
  uint32_t saturated_steps() const { return saturated_steps_; }
  int32_t last_target_umps() const { return last_target_umps_; }
  /// The output was limited in the last step.
  bool saturated() const { return saturated_; }

 private:
  int32_t last_target_umps_ = 0;
  int32_t steady_limit_q15_ = 0;
  uint32_t saturated_steps_ = 0;
  int64_t integral_q32_ = 0;  // duty, q15 with 32 more fractional bits
  bool saturated_ = false;
  ObstacleMemory obstacle_;
};

}  // namespace wheelwire
