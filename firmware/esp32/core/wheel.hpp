// One wheel: its ticks, velocity, control loop and fault detection.
#pragma once

#include "config.hpp"
#include "controller.hpp"
#include "encoder.hpp"
#include "fault_monitor.hpp"
#include "following_error.hpp"
#include "hal.hpp"
#include "plausibility.hpp"
#include "velocity.hpp"

namespace wheelwire {

class Wheel {
 public:
  explicit Wheel(MotorPort& motor) : motor_(&motor) {}

  /// Ticks count from the counter's value at power-on.
  void start(int16_t counter) { total_ = TickTotal(counter); }

  /// Processes a reading of the encoder. Returns the fault that it reveals, if any.
  WheelFault latch(int16_t counter, uint64_t now_us, bool encoder_inverted, int32_t supply_q12,
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

  /// Closed loop, one control step. `command_umps` is the velocity to drive at: `setpoint_umps`,
  /// whose integral is the distance to cover, plus the correction of the following error.
  void drive_velocity(int32_t setpoint_umps, int32_t command_umps, bool motor_inverted,
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
  /// Open loop.
  void drive_duty(int32_t duty_q15, bool motor_inverted) {
    following_.rest();
    direction_ = 0;
    closed_loop_ = false;
    output(duty_q15, motor_inverted);
  }
  void brake() {
    rest();
    brakes_ = true;
    motor_->brake();
  }
  void coast() {
    rest();
    brakes_ = false;
    motor_->coast();
  }
  /// Coasts, unless the windings are shorted, which does not drive either.
  void release() {
    if (!brakes_) coast();
  }
  /// Somebody has cleared the fault: what was seen before does not count any more.
  void end_evidence() {
    monitor_.end_evidence();
    plausibility_.end_evidence();
  }

  // For a robot whose sides are wired to each other's pins.
  void exchange_motors(Wheel& other) {
    MotorPort* const motor = motor_;
    motor_ = other.motor_;
    other.motor_ = motor;
  }
  void exchange_encoders(Wheel& other) { total_.exchange_registers(other.total_); }

  int32_t ticks() const { return total_.ticks(); }
  int32_t velocity_umps() const { return velocity_umps_; }
  /// See VelocityEstimator.
  bool is_still() const { return estimator_.is_still(); }
  /// Whether it has moved on in the last half second, driven or not. One whose encoder rests on an
  /// edge and toggles has not, though it is not still either.
  bool turns() const { return estimator_.ticks_per_s_q8() != 0; }
  int32_t duty_q15() const { return duty_q15_; }
  /// What the winding gets: the stage pauses for a step before it drives the other way.
  int32_t driven_q15() const { return reverses_ ? 0 : duty_q15_; }
  uint32_t saturated_steps() const { return controller_.saturated_steps(); }
  /// How far the wheel is behind the integral of its setpoint.
  int32_t behind_um() const { return following_.um(); }
  void trim_to(int32_t um) { following_.trim_to(um); }
  bool saturated() const { return controller_.saturated(); }

 private:
  /// How much slower the wheel is than commanded.
  int32_t error_umps(int32_t setpoint_umps, int32_t command_umps,
                     const ControlConfig& config) const {
    if (!config.path.follows()) {
      // The measurement lags: on a ramp, compare it with the command of the same moment.
      const int64_t change = static_cast<int64_t>(command_umps) - controller_.last_target_umps();
      return saturate32(command_umps - change * config.gains.delay_steps - velocity_umps_);
    }
    // While ticks are overdue the measured rate is out of date; the setpoint's integral then gives
    // a lower bound.
    const int32_t measured = estimator_.falling_behind_umps();
    const int32_t least = following_.minimum_umps(config.um_per_tick_q10);
    const bool later = least > 0 ? least > measured : least < measured;
    const int64_t behind = least != 0 && later ? least : measured;
    return saturate32(behind + command_umps - setpoint_umps);
  }
  void output(int32_t duty_q15, bool motor_inverted) {
    reverses_ = (duty_q15 < 0 && duty_q15_ > 0) || (duty_q15 > 0 && duty_q15_ < 0);
    brakes_ = false;
    duty_q15_ = duty_q15;
    motor_->drive(static_cast<int16_t>(motor_inverted ? -duty_q15 : duty_q15));
  }
  void rest() {
    controller_.reset(velocity_umps_);
    following_.rest();
    closed_loop_ = false;
    direction_ = 0;
    duty_q15_ = 0;
    reverses_ = false;
  }

  MotorPort* motor_;
  TickTotal total_;
  VelocityEstimator estimator_;
  Controller controller_;
  FaultMonitor monitor_;
  FollowingError following_;
  PlausibilityMonitor plausibility_;
  bool closed_loop_ = false;
  bool reverses_ = false;  // By the newest output.
  bool yields_ = false;    // At a setpoint of zero: to what seems to be a fault, or a push.
  bool brakes_ = false;
  int32_t direction_ = 0;  // Of the setpoint.
  int32_t velocity_umps_ = 0;
  int32_t duty_q15_ = 0;
};

}  // namespace wheelwire
