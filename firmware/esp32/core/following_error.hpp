// The following error: how far a wheel is behind the integral of its setpoint.
#pragma once

#include <stdint.h>

#include "encoder.hpp"
#include "fixed.hpp"

namespace wheelwire {

class FollowingError {
 public:
  /// Call at every control step with the ticks since the last call.
  void update(int32_t change, uint64_t now_us, uint32_t period_us, int32_t um_per_tick_q10) {
    const auto since_us = static_cast<uint32_t>(now_us - now_us_);
    now_us_ = now_us;
    if (following_) {
      const uint32_t elapsed_us = since_us < kMaxElapsed_us ? since_us : kMaxElapsed_us;
      total_q10_ += static_cast<int64_t>(setpoint_umps_) *
                        static_cast<int32_t>(elapsed_us * kQ10PerMillion_q26) >>
                    26;
      total_q10_ -= static_cast<int64_t>(change) * um_per_tick_q10;
    }
    // A tick back and forth is not progress: with one channel stuck there are no others.
    const bool progress = change != 0 && (direction_ == 0 || sign(change) == direction_);
    if (change != 0) direction_ = sign(change);
    if (progress || !following_) {
      at_tick_q10_ = total_q10_;
      tick_us_ = now_us;
    }
    // The wheel may be up to a tick beyond the last edge, which was seen up to a period late, and
    // edges are unevenly spaced. As long as the held value lies within these bounds it stays: a
    // correction that followed every tick would put ripple on the motor.
    const auto exact_um = static_cast<int32_t>((total_q10_ - trimmed_q10_) >> 10);
    const int32_t tick_um = um_per_tick_q10 >> 10;
    const int32_t late_um = scale(magnitude(setpoint_umps_), static_cast<int32_t>(period_us), 20);
    const int32_t uneven_um = tick_um * 2 / 5;
    const int32_t beyond_um = tick_um + late_um + uneven_um;
    const bool forward = setpoint_umps_ >= 0;
    held_um_ = clamp(held_um_, exact_um - (forward ? beyond_um : uneven_um),
                     exact_um + (forward ? uneven_um : beyond_um));
  }
  /// Sets the setpoint from now on.
  void set_target(int32_t setpoint_umps) {
    following_ = true;
    setpoint_umps_ = setpoint_umps;
  }
  /// The wheel has no setpoint any more: freezes the error.
  void rest() {
    following_ = false;
    setpoint_umps_ = 0;
    direction_ = 0;
  }
  /// A wheel that stands is to go the other way: what it fell behind before says nothing about how
  /// fast it does so from now on.
  void turn_back() {
    at_tick_q10_ = total_q10_;
    tick_us_ = now_us_;
  }
  /// Drops all of the error except `um`.
  void trim_to(int32_t um) {
    trimmed_q10_ += static_cast<int64_t>(held_um_ - um) << 10;
    held_um_ = um;
  }

  /// The error to correct. Between ticks the wheel's exact position is unknown, so the last value
  /// is held for as long as it remains possible: at constant speed it has no ripple.
  int32_t um() const { return held_um_; }
  /// Total since the start, including what was dropped, um x 16, modulo 2^32.
  uint32_t total_q4() const { return static_cast<uint32_t>(total_q10_ >> 6); }
  /// While ticks are overdue: the lowest rate at which the wheel can be falling behind, um/s; 0
  /// while it may not be.
  int32_t minimum_umps(int32_t um_per_tick_q10) const {
    const int32_t since_um = saturate32((total_q10_ - at_tick_q10_) >> 10);
    const int32_t tick_um = um_per_tick_q10 >> 10;
    const auto silence_us = static_cast<uint32_t>(now_us_ - tick_us_);
    if (magnitude(since_um) <= tick_um + tick_um / 2 || silence_us == 0) return 0;
    const int64_t certain_um = since_um - sign(since_um) * tick_um;
    return saturate32(certain_um * (4'096'000'000u / silence_us) >> 12);
  }

 private:
  // um/s x us is um x 1e6; x 1024 / 1e6 is um x 1024.
  static constexpr uint32_t kQ10PerMillion_q26 = 68'719;

  // A longer interval counts as this, so that the product below stays within 32 bits.
  static constexpr uint32_t kMaxElapsed_us = 31'000;

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
