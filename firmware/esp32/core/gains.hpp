// The parameters of one wheel's velocity loop, scaled for it.
#pragma once

#include "fixed.hpp"

namespace wheelwire {

struct ControllerGains {
  int32_t proportional_q24;  ///< q15 duty per um/s.
  int32_t integral_q32;      ///< q15 duty per um/s, per control step.
  int32_t feedforward_q24;   ///< q15 duty per um/s.
  int32_t acceleration_q24;  ///< q15 duty per um/s of the target's change, per control step.
  int32_t delay_steps;       ///< Latency of the measured velocity, in control steps.
  int32_t static_q15;        ///< Duty that just overcomes friction.
  int32_t margin_q15;        ///< Duty beyond the feed-forward, for loads.
  int32_t limit_q15;         ///< Limit of the output, in either direction.
  int32_t slew_umps;         ///< Largest change of a setpoint per control step.
  int32_t memory_shift;      ///< Log2 of the control steps that ObstacleMemory averages over.
};

}  // namespace wheelwire
