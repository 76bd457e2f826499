#include "wheel.hpp"

namespace wheelwire {

WheelFault Wheel::latch(int16_t counter, uint64_t now_us, bool encoder_inverted,
                        const ControlConfig& config) {
  const int32_t change = total_.update(counter, encoder_inverted);
  estimator_.update(change, now_us, config.velocity_window_us);
  velocity_umps_ = multiply_shift(estimator_.ticks_per_s_q8(), config.um_per_tick_q10, 18);
  return monitor_.update(duty_q15_, total_.ticks(), velocity_umps_, now_us, config.faults);
}

void Wheel::drive_velocity(int32_t target_umps, bool motor_inverted, const ControllerGains& gains) {
  if (target_umps == 0 && velocity_umps_ == 0) {
    // Arrived at rest: shorted windings hold better than an integrator that hums.
    brake();
    return;
  }
  drive_duty(controller_.update(target_umps, velocity_umps_, gains), motor_inverted);
}

void Wheel::drive_duty(int32_t duty_q15, bool motor_inverted) {
  duty_q15_ = duty_q15;
  motor_.drive(static_cast<int16_t>(motor_inverted ? -duty_q15 : duty_q15));
}

void Wheel::brake() {
  rest();
  motor_.brake();
}

void Wheel::coast() {
  rest();
  motor_.coast();
}

void Wheel::rest() {
  controller_.reset(velocity_umps_);
  monitor_.reset();
  duty_q15_ = 0;
}

}  // namespace wheelwire
