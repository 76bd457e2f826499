// One wheel's velocity loop: feed-forward, and a PI controller for the rest.
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

/// Undoes the windup of a blocked wheel. While the wheel is held, the integral grows to a value
/// that would throw it forward on release. A released wheel gains speed faster than the slew limit
/// lets any setpoint do, which a wheel under a heavy load does not: then the integral returns to
/// its average from before, when the wheel was rolling.
class ObstacleMemory {
 public:
  /// Call once per control step. Returns the integral to continue with.
  int64_t update(int64_t integral_q32, int32_t target_umps, int32_t error_umps,
                 const ControllerGains& gains);
  void reset() { *this = {}; }
  /// Call when a wheel that stands is to go the other way: what it built up against an obstacle
  /// does not count there. Returns the integral to continue with.
  int64_t turn_back() {
    held_ = false;
    rolled_steps_ = 0;
    return rolling_q32_;
  }

 private:
  bool held_ = false;
  int32_t rolled_steps_ = 0;
  int32_t gain_umps_ = 0;  // How far a setpoint could have slewed since the wheel moved again.
  int64_t rolling_q32_ = 0;
};

class Controller {
 public:
  /// Call once per control step with how much slower the wheel is than commanded. Returns the
  /// duty, q15.
  int32_t update(int32_t target_umps, int32_t error_umps, int32_t supply_q12,
                 const ControllerGains& gains);
  /// Clears the integral; the wheel moves at `measured_umps`.
  void reset(int32_t measured_umps) {
    integral_q32_ = 0;
    last_target_umps_ = measured_umps;
    saturated_ = false;
    obstacle_.reset();
  }
  /// Call when a standing wheel is to go the other way. Otherwise the loop would drive it the old
  /// way until the integral is undone. At a low speed that takes seconds, and delays detection of a
  /// wheel fault by as much.
  void turn_back() { integral_q32_ = obstacle_.turn_back(); }
  /// The limit of the last step's output, without what a change of the target adds to it.
  int32_t steady_limit_q15() const { return steady_limit_q15_; }
  /// Control steps in which the output was limited. Wraps.
  uint32_t saturated_steps() const { return saturated_steps_; }
  int32_t last_target_umps() const { return last_target_umps_; }
  /// The output was limited in the last step.
  bool saturated() const { return saturated_; }

 private:
  int32_t last_target_umps_ = 0;
  int32_t steady_limit_q15_ = 0;
  uint32_t saturated_steps_ = 0;
  int64_t integral_q32_ = 0;  // duty, q15 with 32 more fractional bits
  bool saturated_ = false;
  ObstacleMemory obstacle_;
};

}  // namespace wheelwire
