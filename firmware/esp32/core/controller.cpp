#include "controller.hpp"

namespace wheelwire {

int32_t Controller::update(int32_t target_umps, int32_t measured_umps,
                           const ControllerGains& gains) {
  const int32_t change = saturate32(static_cast<int64_t>(target_umps) - last_target_umps_);
  last_target_umps_ = target_umps;
  // On a ramp the measurement is compared with the target of its own time.
  const int64_t expected = target_umps - static_cast<int64_t>(change) * gains.delay_steps;
  const int32_t error = saturate32(expected - measured_umps);
  const int64_t limit_q32 = static_cast<int64_t>(gains.limit_q15) << 32;
  int64_t sum = sign(target_umps) * gains.static_q15;
  sum += multiply_shift(gains.feedforward_q24, target_umps, 24);
  sum += multiply_shift(gains.acceleration_q24, change, 24);
  sum += multiply_shift(gains.proportional_q24, error, 24);
  sum += integral_q32_ >> 32;
  const int32_t wanted = saturate32(sum);
  const int32_t duty = clamp(wanted, -gains.limit_q15, gains.limit_q15);
  if (wanted != duty) ++saturated_steps_;
  // Anti-windup: what the output cannot give is not asked for more and more.
  const bool saturated = wanted != duty && sign(error) == sign(wanted);
  if (!saturated) {
    const int64_t step_q32 = static_cast<int64_t>(gains.integral_q32) * error;
    integral_q32_ = clamp(integral_q32_ + step_q32, -limit_q32, limit_q32);
  }
  return duty;
}

}  // namespace wheelwire
