// The following error: how far a wheel is behind the integral of its setpoint.
#pragma once

#include <stdint.h>

#include "encoder.hpp"

namespace wheelwire {

class FollowingError {
 public:
  /// Call at every control step with the ticks since the last call.
  void update(int32_t change, uint64_t now_us, uint32_t period_us, int32_t um_per_tick_q10);
  /// Sets the setpoint from now on.
  void set_target(int32_t setpoint_umps);
  /// The wheel has no setpoint any more: freezes the error.
  void rest();
  /// A wheel that stands is to go the other way: what it fell behind before says nothing about how
  /// fast it does so from now on.
  void turn_back() {
    at_tick_q10_ = total_q10_;
    tick_us_ = now_us_;
  }
  /// Drops all of the error except `um`.
  void trim_to(int32_t um);

  /// The error to correct. Between ticks the wheel's exact position is unknown, so the last value
  /// is held for as long as it remains possible: at constant speed it has no ripple.
  int32_t um() const { return held_um_; }
  /// Total since the start, including what was dropped, um x 16, modulo 2^32.
  uint32_t total_q4() const { return static_cast<uint32_t>(total_q10_ >> 6); }
  /// While ticks are overdue: the lowest rate at which the wheel can be falling behind, um/s; 0
  /// while it may not be.
  int32_t minimum_umps(int32_t um_per_tick_q10) const;

 private:
  int64_t total_q10_ = 0;
  int64_t at_tick_q10_ = 0;  // total_q10_ at the last tick.
  int64_t trimmed_q10_ = 0;
  int32_t held_um_ = 0;
  int32_t setpoint_umps_ = 0;
  int32_t direction_ = 0;  // Direction of the last tick; 0: no tick since rest().
  bool following_ = false;
  uint64_t now_us_ = 0;
  uint64_t tick_us_ = 0;
};

}  // namespace wheelwire
