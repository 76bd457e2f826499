#include "wheel.hpp"

namespace wheelwire {

WheelFault Wheel::latch(int16_t counter, uint64_t now_us, bool encoder_inverted, int32_t supply_q12,
                        const ControlConfig& config) {
  const int32_t change = total_.update(counter, encoder_inverted);
  following_.update(change, now_us, config.period_us, config.um_per_tick_q10);
  estimator_.update(change, following_.total_q4(), now_us, config.period_us,
                    config.velocity_window_us);
  velocity_umps_ = multiply_shift(estimator_.ticks_per_s_q8(), config.um_per_tick_q10, 18);
  const int32_t limit_q15 = closed_loop_ ? controller_.steady_limit_q15() : WheelOutput::kNoLimit;
  WheelFault fault = monitor_.update({duty_q15_, limit_q15, direction_}, total_.ticks(),
                                     velocity_umps_, config.period_us, config.faults);
  if (!closed_loop_) {
    plausibility_.rest(config.period_us);
    return fault;
  }
  // A duty against the setpoint brakes, or is what an obstacle left in the loop: soon over.
  const int32_t along_q15 = duty_q15_ * direction_ < 0 ? 0 : duty_q15_;
  if (fault == WheelFault::kNone &&
      plausibility_.update(along_q15, velocity_umps_, change != 0, supply_q12, config.period_us,
                           config.plausibility_time_us, config.gains))
    fault = WheelFault::kImplausible;
  if (fault == WheelFault::kNone || direction_ != 0) return fault;
  // Pushing a robot whose setpoint is zero is not a fault. But inverted feedback would help the
  // push, so the wheel is braked instead of driven.
  yields_ = true;
  end_evidence();
  return WheelFault::kNone;
}

void Wheel::drive_velocity(int32_t setpoint_umps, int32_t command_umps, bool motor_inverted,
                           int32_t supply_q12, const ControlConfig& config) {
  if (direction_ * sign(setpoint_umps) < 0 && velocity_umps_ == 0) {
    controller_.turn_back();
    following_.turn_back();
  }
  direction_ = sign(setpoint_umps);
  if (setpoint_umps == 0 && (velocity_umps_ == 0 || yields_)) {
    yields_ = velocity_umps_ != 0;
    // At rest, shorted windings hold the wheel without the hum of an integrator.
    brake();
    return;
  }
  yields_ = false;
  const int32_t error = error_umps(setpoint_umps, command_umps, config);
  if (config.path.follows()) following_.set_target(setpoint_umps);
  closed_loop_ = true;
  output(controller_.update(command_umps, error, supply_q12, config.gains), motor_inverted);
}

/// How much slower the wheel is than commanded.
int32_t Wheel::error_umps(int32_t setpoint_umps, int32_t command_umps,
                          const ControlConfig& config) const {
  if (!config.path.follows()) {
    // The measurement lags: on a ramp, compare it with the command of the same moment.
    const int64_t change = static_cast<int64_t>(command_umps) - controller_.last_target_umps();
    return saturate32(command_umps - change * config.gains.delay_steps - velocity_umps_);
  }
  // While ticks are overdue the measured rate is out of date; the setpoint's integral then gives a
  // lower bound.
  const int32_t measured = estimator_.falling_behind_umps();
  const int32_t least = following_.minimum_umps(config.um_per_tick_q10);
  const bool later = least > 0 ? least > measured : least < measured;
  const int64_t behind = least != 0 && later ? least : measured;
  return saturate32(behind + command_umps - setpoint_umps);
}

void Wheel::drive_duty(int32_t duty_q15, bool motor_inverted) {
  following_.rest();
  direction_ = 0;
  closed_loop_ = false;
  output(duty_q15, motor_inverted);
}

void Wheel::output(int32_t duty_q15, bool motor_inverted) {
  reverses_ = (duty_q15 < 0 && duty_q15_ > 0) || (duty_q15 > 0 && duty_q15_ < 0);
  brakes_ = false;
  duty_q15_ = duty_q15;
  motor_->drive(static_cast<int16_t>(motor_inverted ? -duty_q15 : duty_q15));
}

void Wheel::brake() {
  rest();
  brakes_ = true;
  motor_->brake();
}

void Wheel::coast() {
  rest();
  brakes_ = false;
  motor_->coast();
}

void Wheel::release() {
  if (!brakes_) coast();
}

void Wheel::exchange_motors(Wheel& other) {
  MotorPort* const motor = motor_;
  motor_ = other.motor_;
  other.motor_ = motor;
}

void Wheel::rest() {
  controller_.reset(velocity_umps_);
  following_.rest();
  closed_loop_ = false;
  direction_ = 0;
  duty_q15_ = 0;
  reverses_ = false;
}

}  // namespace wheelwire
