// One wheel: what it has turned, how fast it turns, what drives it, what is wrong with it.
#pragma once

#include "config.hpp"
#include "controller.hpp"
#include "encoder.hpp"
#include "fault_monitor.hpp"
#include "hal.hpp"
#include "velocity.hpp"

namespace wheelwire {

class Wheel {
 public:
  explicit Wheel(MotorPort& motor) : motor_(motor) {}

  /// The counter's value at power-on is no travel.
  void start(int16_t counter) { total_ = TickTotal(counter); }

  /// Takes a reading of the encoder. Returns what it says of the wheel's health.
  WheelFault latch(int16_t counter, uint64_t now_us, bool encoder_inverted, const ControlConfig&);

  /// Closed loop, one control step.
  void drive_velocity(int32_t target_umps, bool motor_inverted, const ControllerGains& gains);
  /// Open loop.
  void drive_duty(int32_t duty_q15, bool motor_inverted);
  void brake();
  void coast();

  int32_t ticks() const { return total_.ticks(); }
  int32_t velocity_umps() const { return velocity_umps_; }
  int32_t duty_q15() const { return duty_q15_; }
  uint32_t saturated_steps() const { return controller_.saturated_steps(); }

 private:
  void rest();

  MotorPort& motor_;
  TickTotal total_;
  VelocityEstimator estimator_;
  Controller controller_;
  FaultMonitor monitor_;
  int32_t velocity_umps_ = 0;
  int32_t duty_q15_ = 0;
};

}  // namespace wheelwire
