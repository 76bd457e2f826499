#include "l298n.hpp"

namespace wheelwire {

void L298n::drive(int16_t duty_q15) {
  if (duty_q15 == 0) {
    coast();
    return;
  }
  const bool forward = duty_q15 > 0;
  if (!switch_inputs(forward ? Inputs::kForward : Inputs::kReverse)) return;
  pins_.set_enable(static_cast<uint16_t>(forward ? duty_q15 : -duty_q15));
  enabled_ = true;
}

void L298n::brake() {
  if (!switch_inputs(Inputs::kBrake)) return;
  pins_.set_enable(INT16_MAX);
  enabled_ = true;
}

void L298n::coast() {
  pins_.set_enable(0);
  enabled_ = false;
}

/// True when the inputs are as wanted; false when EN must stay low for this period first.
bool L298n::switch_inputs(Inputs wanted) {
  if (inputs_ == wanted) return true;
  if (enabled_) {
    coast();
    return false;
  }
  pins_.set_inputs(wanted == Inputs::kForward, wanted == Inputs::kReverse);
  inputs_ = wanted;
  return true;
}

}  // namespace wheelwire
