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
  int32_t margin_q15;        ///< Duty beyond the feed-forward that loads may need.
  int32_t limit_q15;         ///< Of the output, either way.
  int32_t slew_umps;         ///< The most that a setpoint changes in a control step.
  int32_t memory_shift;      ///< The control steps that ObstacleMemory looks back, as log2.
};

/// What the integral learns from a wheel that is held fast is wrong once it is let go, and would
/// throw it forward. A wheel that was let go, and not merely heavy, gains speed faster than any
/// setpoint may; then the integral is what it was while the wheel rolled.
class ObstacleMemory {
 public:
  /// Returns the integral to go on with.
  int64_t update(int64_t integral_q32, int32_t target_umps, int32_t error_umps,
                 const ControllerGains& gains);
  void reset() { *this = {}; }

 private:
  bool held_ = false;
  int32_t rolled_steps_ = 0;
  int32_t gain_umps_ = 0;  // What a setpoint could have gained since the wheel moves again.
  int64_t rolling_q32_ = 0;
};

class Controller {
 public:
  /// Returns the duty, q15. Call once per control step with how much too slow the wheel is.
  int32_t update(int32_t target_umps, int32_t error_umps, int32_t supply_q12,
                 const ControllerGains& gains);
  /// Forgets what it has learned; the wheel moves at `measured_umps`.
  void reset(int32_t measured_umps) {
    integral_q32_ = 0;
    last_target_umps_ = measured_umps;
    saturated_ = false;
    obstacle_.reset();
  }
  /// How often the output could not give what was wanted. Wraps.
  uint32_t saturated_steps() const { return saturated_steps_; }
  int32_t last_target_umps() const { return last_target_umps_; }
  /// The output was at its limit at the last step.
  bool saturated() const { return saturated_; }

 private:
  int32_t last_target_umps_ = 0;
  uint32_t saturated_steps_ = 0;
  int64_t integral_q32_ = 0;  // duty, q15 with 32 more fractional bits
  bool saturated_ = false;
  ObstacleMemory obstacle_;
};

}  // namespace wheelwire
