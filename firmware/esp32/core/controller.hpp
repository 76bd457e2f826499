// One wheel's velocity loop: feed-forward, and a PI controller for what it does not know.
#pragma once

#include "fixed.hpp"

namespace wheelwire {

struct ControllerGains {
  int32_t proportional_q24;  ///< q15 duty per um/s.
  int32_t integral_q32;      ///< q15 duty per um/s, per control step.
  int32_t feedforward_q24;   ///< q15 duty per um/s.
  int32_t acceleration_q24;  ///< q15 duty per um/s of the target's change, per control step.
  int32_t delay_steps;       ///< How many control steps the measured velocity is behind.
  int32_t static_q15;        ///< Duty that just overcomes friction.
  int32_t limit_q15;         ///< Of the output, either way.
};

class Controller {
 public:
  /// Returns the duty, q15. Call once per control step.
  int32_t update(int32_t target_umps, int32_t measured_umps, const ControllerGains& gains);
  /// Forgets what it has learned; the wheel moves at `measured_umps`.
  void reset(int32_t measured_umps) {
    integral_q32_ = 0;
    last_target_umps_ = measured_umps;
  }
  /// How often the output could not give what was wanted. Wraps.
  uint32_t saturated_steps() const { return saturated_steps_; }

 private:
  int32_t last_target_umps_ = 0;
  uint32_t saturated_steps_ = 0;
  int64_t integral_q32_ = 0;  // duty, q15 with 32 more fractional bits
};

}  // namespace wheelwire
