#include "controller.hpp"

#include "plausibility.hpp"

namespace wheelwire {

int32_t Controller::update(int32_t target_umps, int32_t error_umps, int32_t supply_q12,
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

int64_t ObstacleMemory::update(int64_t integral_q32, int32_t target_umps, int32_t error_umps,
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

}  // namespace wheelwire
