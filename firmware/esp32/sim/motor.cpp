#include "motor.hpp"

#include <cmath>
#include <numbers>

namespace wheelwire::sim {

namespace {

/// Where static friction has faded halfway [rad/s].
constexpr double kStribeckSpeed = 0.3;

}  // namespace

double Friction::torque(double speed) const {
  const double ratio = speed / kStribeckSpeed;
  const double dry = coulomb_nm + std::max(0.0, static_nm - coulomb_nm) / (1.0 + ratio * ratio);
  return dry + viscous_nms * std::abs(speed);
}

MotorConstants derive(const MotorRating& rating, const BridgeModel& bridge,
                      const Friction& friction) {
  const double voltage = rating.supply_v - bridge.drop_v;
  const double circuit_ohm = voltage / rating.stall_current_a;
  const double torque_per_amp = rating.stall_torque_nm / rating.stall_current_a;
  const double no_load_speed = rating.no_load_rpm * 2.0 * std::numbers::pi / 60.0;
  const double no_load_current = friction.torque(no_load_speed) / torque_per_amp;
  return {
      .winding_ohm = circuit_ohm - bridge.drop_ohm,
      .torque_nm_per_a = torque_per_amp,
      .emf_vs = (voltage - circuit_ohm * no_load_current) / no_load_speed,
  };
}

WheelMotion step_wheel(const WheelMotion& wheel, double dt, double inertia, double current_a,
                       double torque_nm_per_a, const Friction& friction, const WheelLoad& load) {
  if (load.blocked) return {.speed = 0.0, .current_a = current_a};
  const double torque = torque_nm_per_a * current_a - load.torque_nm;
  double speed = wheel.speed;
  if (speed == 0.0) {
    if (std::abs(torque) <= friction.static_nm) return {.speed = 0.0, .current_a = current_a};
    speed = dt / inertia * (torque - std::copysign(friction.static_nm, torque));
  } else {
    speed += dt / inertia * (torque - std::copysign(friction.torque(speed), speed));
    if (speed * wheel.speed < 0.0) speed = 0.0;
  }
  return {.speed = speed, .current_a = current_a};
}

}  // namespace wheelwire::sim
