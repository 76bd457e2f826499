// A DC gear motor with its wheel. All constants are on the wheel's side of the gearbox.
#pragma once

#include <cmath>
#include <numbers>

#include "bridge.hpp"

namespace wheelwire::sim {

/// The figures of a motor's data sheet.
struct MotorRating {
  double supply_v = 7.4;      ///< Supply of the figures below.
  bool at_terminals = false;  ///< Measured at the terminals; false: behind the bridge.
  double no_load_rpm = 200.0;
  double stall_current_a = 1.0;
  double stall_torque_nm = 0.09;  ///< At the wheel, so the gearbox's losses are in it.
};

struct Friction {
  double coulomb_nm = 0.006;
  double static_nm = 0.009;  ///< To break away; fades to coulomb_nm as the wheel turns.
  double viscous_nms = 1e-4;

  /// Where static friction has faded halfway [rad/s].
  static constexpr double kStribeckSpeed = 0.3;

  /// Against the motion, at `speed` [rad/s].
  double torque(double speed) const {
    const double ratio = speed / kStribeckSpeed;
    const double dry = coulomb_nm + std::max(0.0, static_nm - coulomb_nm) / (1.0 + ratio * ratio);
    return dry + viscous_nms * std::abs(speed);
  }
};

struct MotorConstants {
  double winding_ohm;
  double torque_nm_per_a;
  double emf_vs;  ///< [V s/rad]
};

/// With V = supply - drop_v and the drop's slope r, both 0 for a rating at the motor's terminals:
///   R  = V / stall current - r;
///   kt = stall torque / stall current;
///   ke = (V - (R + r) i0) / w0, where i0 = friction(w0) / kt is the no-load current.
/// ke exceeds kt by the gearbox's losses.
inline MotorConstants derive(const MotorRating& rating, const BridgeModel& bridge,
                             const Friction& friction) {
  const double drop_ohm = rating.at_terminals ? 0.0 : bridge.drop_ohm;
  const double voltage = rating.supply_v - (rating.at_terminals ? 0.0 : bridge.drop_v);
  const double circuit_ohm = voltage / rating.stall_current_a;
  const double torque_per_amp = rating.stall_torque_nm / rating.stall_current_a;
  const double no_load_speed = rating.no_load_rpm * 2.0 * std::numbers::pi / 60.0;
  const double no_load_current = friction.torque(no_load_speed) / torque_per_amp;
  return {
      .winding_ohm = circuit_ohm - drop_ohm,
      .torque_nm_per_a = torque_per_amp,
      .emf_vs = (voltage - circuit_ohm * no_load_current) / no_load_speed,
  };
}

/// External load on one wheel.
struct WheelLoad {
  double torque_nm = 0.0;  ///< Against forward.
  bool blocked = false;    ///< Held fast.
};

struct WheelMotion {
  double speed = 0.0;      ///< [rad/s], forward positive.
  double current_a = 0.0;  ///< Through the winding.
};

/// One explicit Euler step of `dt` seconds. Static friction holds a standing wheel at exactly zero,
/// and a wheel whose speed changes sign stops at zero first, so friction never chatters.
inline WheelMotion step_wheel(const WheelMotion& wheel, double dt, double inertia, double current_a,
                              double torque_nm_per_a, const Friction& friction,
                              const WheelLoad& load) {
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
