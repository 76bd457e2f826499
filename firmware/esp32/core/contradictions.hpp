// Parameters that are each within their bounds and still contradict each other, or the board: the
// only place where such rules are written.
#pragma once

#include "parameters.hpp"

namespace wheelwire {

/// Flags of `contradiction`. `max_pwm_hz`: what the board's power stage can switch; 0: not known.
uint32_t contradictions(const Parameters& parameters, uint32_t max_pwm_hz);

}  // namespace wheelwire
