// A power stage seen from the winding: its inputs and the back-EMF in, current out.
#pragma once

#include <algorithm>
#include <cmath>

namespace wheelwire::sim {

/// What a winding is connected to.
enum class Winding { kOpen, kShorted, kForward, kReverse };

/// What the inputs of a power stage make of its winding in a PWM period: `on` for `duty` of it,
/// then `off`. Where one of them drives, `on` does; both do where the PWM lies on a direction
/// input.
struct BridgeState {
  Winding on = Winding::kOpen;
  Winding off = Winding::kOpen;
  double duty = 0.0;  ///< 0..1.

  bool is_forward() const { return on == Winding::kForward; }
  bool drives() const { return duty > 0.0 && (is_forward() || on == Winding::kReverse); }
  bool alternates() const { return off == Winding::kForward || off == Winding::kReverse; }
  /// -1..1, forward positive; 0 when braking or coasting.
  double signed_duty() const {
    if (!drives()) return 0.0;
    const double net = alternates() && off != on ? 2.0 * duty - 1.0 : duty;
    return is_forward() ? net : -net;
  }
  /// How much of the period the winding is shorted.
  double shorted() const {
    return (on == Winding::kShorted ? duty : 0.0) + (off == Winding::kShorted ? 1.0 - duty : 0.0);
  }
};

struct BridgeModel {
  double supply_v = 7.4;
  /// Both saturated transistors: drop_v + drop_ohm * current. An L298N's total drop is 1.8 to 3.2 V
  /// at 1 A and at most 4.9 V at 2 A by its data sheet.
  double drop_v = 1.3;
  double drop_ohm = 1.2;
  /// Where the winding is open in the PWM's off time. False: its inductance sustains the current,
  /// so the motor sees the average voltage. True: the current dies out (low PWM frequency, small
  /// inductance), which raises the duty-to-speed curve, and a low duty never brakes. Real motors
  /// lie between the two.
  bool chopped = false;

  /// Average current [A] through a winding of `winding_ohm` with back-EMF `emf` [V]. Quasi-static:
  /// a gear motor's L/R is a fraction of a millisecond, far below its mechanical time constant.
  double current(const BridgeState& state, double emf, double winding_ohm) const {
    if (!state.drives()) {
      if (state.shorted() <= 0.0) return 0.0;  // Coasting: the diodes block below the supply.
      // Braking: through one transistor and one diode, so no current below their drop.
      const double voltage = std::max(0.0, std::abs(emf) - drop_v);
      return -std::copysign(state.shorted() * voltage / (winding_ohm + drop_ohm), emf);
    }
    const double full = std::max(0.0, supply_v - drop_v);
    if (state.off != Winding::kOpen)
      return (state.signed_duty() * full - emf) / (winding_ohm + drop_ohm);
    const double sign = state.is_forward() ? 1.0 : -1.0;
    if (chopped) {
      const double on_current = (sign * full - emf) / (winding_ohm + drop_ohm);
      return on_current * sign > 0.0 ? state.duty * on_current : 0.0;
    }
    return (state.duty * sign * full - emf) / (winding_ohm + state.duty * drop_ohm);
  }
};

}  // namespace wheelwire::sim
