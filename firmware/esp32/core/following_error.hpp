// The following error: how far a wheel is behind the integral of its setpoint.
#pragma once

#include <stdint.h>

#include "encoder.hpp"

namespace wheelwire {

class FollowingError {
 public:
  /// Call at every control step with the ticks since the last call.
  void update(int32_t change, uint64_t now_us, uint32_t period_us, int32_t um_per_tick_q10);
  /// The setpoint from now on.
  void set_target(int32_t setpoint_umps);
  /// The wheel has no setpoint: the error stays as it is.
  void rest();
  /// Drops all of the error but `um`.
  void forget_but(int32_t um);

  /// The error to make up. Between two ticks the wheel's position is uncertain, so this value is
  /// kept for as long as it is possible: at constant speed it has no ripple.
  int32_t um() const { return held_um_; }
  /// Total since the start, with what was dropped, um x 16, modulo 2^32.
  uint32_t total_q4() const { return static_cast<uint32_t>(total_q10_ >> 6); }
  /// While no tick comes: the least speed at which the wheel must be falling behind; 0 while that
  /// is unknown.
  int32_t least_umps(int32_t um_per_tick_q10) const;

 private:
  int64_t total_q10_ = 0;
  int64_t at_tick_q10_ = 0;  // Of total_q10_.
  int64_t forgotten_q10_ = 0;
  int32_t held_um_ = 0;
  int32_t setpoint_umps_ = 0;
  int32_t direction_ = 0;  // Of the last tick; 0: none since rest.
  bool following_ = false;
  uint64_t now_us_ = 0;
  uint64_t tick_us_ = 0;
};

}  // namespace wheelwire
