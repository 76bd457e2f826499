// One half of an L298N seen from the winding: pins and back-EMF in, current out.
#pragma once

#include <algorithm>
#include <cmath>

namespace wheelwire::sim {

/// The pins as the chip drives them. Pull-downs keep EN low while the chip is in reset.
struct BridgePins {
  bool in1 = false;
  bool in2 = false;
  double enable = 0.0;  ///< PWM duty on EN, 0..1.

  bool drives() const { return enable > 0.0 && in1 != in2; }
  /// -1..1, forward positive; 0 when braking or coasting.
  double signed_duty() const { return drives() ? (in1 ? enable : -enable) : 0.0; }
};

struct BridgeModel {
  double supply_v = 7.4;
  /// Both saturated transistors: drop_v + drop_ohm * current. The datasheet's total drop is 1.8 to
  /// 3.2 V at 1 A and at most 4.9 V at 2 A.
  double drop_v = 1.3;
  double drop_ohm = 1.2;
  /// False: the winding's inductance sustains the current during the PWM's off time, so the motor
  /// sees the average voltage. True: the current dies out as EN falls (low PWM frequency, small
  /// inductance), which raises the duty-to-speed curve, and a low duty never brakes. Real motors
  /// lie between the two.
  bool chopped = false;

  /// Average current [A] through a winding of `winding_ohm` with back-EMF `emf` [V]. Quasi-static:
  /// a gear motor's L/R is a fraction of a millisecond, far below its mechanical time constant.
  double current(const BridgePins& pins, double emf, double winding_ohm) const {
    if (pins.enable <= 0.0) return 0.0;  // Coast: the diodes block below the supply voltage.
    if (pins.in1 == pins.in2) {
      // Brake: shorted through one transistor and one diode, so no current below their drop.
      const double voltage = std::max(0.0, std::abs(emf) - drop_v);
      return -std::copysign(pins.enable * voltage / (winding_ohm + drop_ohm), emf);
    }
    const double sign = pins.in1 ? 1.0 : -1.0;
    const double on_voltage = sign * std::max(0.0, supply_v - drop_v);
    if (chopped) {
      const double on_current = (on_voltage - emf) / (winding_ohm + drop_ohm);
      return on_current * sign > 0.0 ? pins.enable * on_current : 0.0;
    }
    return (pins.enable * on_voltage - emf) / (winding_ohm + pins.enable * drop_ohm);
  }
};

}  // namespace wheelwire::sim
