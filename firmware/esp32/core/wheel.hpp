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
                   const ControlConfig&);

  /// Closed loop, one control step. `command_umps` is the velocity to drive at: `setpoint_umps`,
  /// whose integral is the distance to cover, plus the correction of the following error.
  void drive_velocity(int32_t setpoint_umps, int32_t command_umps, bool motor_inverted,
                      int32_t supply_q12, const ControlConfig& config);
  /// Open loop.
  void drive_duty(int32_t duty_q15, bool motor_inverted);
  void brake();
  void coast();
  /// Coasts, unless the windings are shorted, which does not drive either.
  void release();
  /// Somebody has cleared the fault: what was seen before does not count any more.
  void end_evidence() {
    monitor_.end_evidence();
    plausibility_.end_evidence();
  }

  // For a robot whose sides are wired to each other's pins.
  void exchange_motors(Wheel& other);
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
  int32_t error_umps(int32_t setpoint_umps, int32_t command_umps, const ControlConfig&) const;
  void output(int32_t duty_q15, bool motor_inverted);
  void rest();

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
