// A DC gear motor with its wheel. All constants are on the wheel's side of the gearbox.
#pragma once

#include "bridge.hpp"

namespace wheelwire::sim {

/// The figures of a motor's data sheet, at the nominal supply behind the bridge.
struct MotorRating {
  double supply_v = 7.4;  ///< At which the other three hold.
  double no_load_rpm = 200.0;
  double stall_current_a = 1.0;
  double stall_torque_nm = 0.09;  ///< At the wheel, so the gearbox's losses are in it.
};

struct Friction {
  double coulomb_nm = 0.006;
  double static_nm = 0.009;  ///< To break away; fades to coulomb_nm as the wheel turns.
  double viscous_nms = 1e-4;

  /// Against the motion, at `speed` [rad/s].
  double torque(double speed) const;
};

struct MotorConstants {
  double winding_ohm;
  double torque_nm_per_a;
  double emf_vs;  ///< [V s/rad]
};

/// With V = supply - drop_v and the drop's slope r:
///   R  = V / stall current - r;
///   kt = stall torque / stall current;
///   ke = (V - (R + r) i0) / w0, where i0 = friction(w0) / kt is the no-load current.
/// ke exceeds kt by the gearbox's losses.
MotorConstants derive(const MotorRating& rating, const BridgeModel& bridge,
                      const Friction& friction);

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
WheelMotion step_wheel(const WheelMotion& wheel, double dt, double inertia, double current_a,
                       double torque_nm_per_a, const Friction& friction, const WheelLoad& load);

}  // namespace wheelwire::sim
