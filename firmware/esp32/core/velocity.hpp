// Wheel velocity from ticks and the time between them.
//
// At low speed a control period has 0 or 1 ticks: at 0.03 m/s and 360 counts a turn one comes every
// 19 ms. So velocity is measured between two ticks some time apart; while the next tick is overdue,
// the time without it is an upper bound.
//
// A tick is seen up to one control period late, by an amount that depends on the ratio of ticks to
// steps. For this to average out at every speed, both ends of the measurement are chosen by the
// same rule at every step: the newest tick known now, and the tick that was the newest a window
// ago. Choosing either end by when its tick was seen biases the mean by up to 1.6 %, and choosing
// the length by the number of ticks in it by up to 3.3 % at 100 control steps a second.
#pragma once

#include <stdint.h>

#include "fixed.hpp"
#include "ring.hpp"

namespace wheelwire {

class VelocityEstimator {
 public:
  struct Tick {
    uint32_t ticks;
    uint32_t t_us;
    uint32_t behind_q4;
  };
  /// Which tick was the newest one at `noted_us`.
  struct Mark {
    Tick newest;
    uint32_t noted_us;
  };

  /// Call at every control step with the ticks since the last call, and with how far the wheel is
  /// behind its setpoint, um x 16 (modulo 2^32).
  void update(int32_t change, uint32_t behind_q4, uint64_t now_us, uint32_t period_us,
              uint32_t window_us) {
    const uint32_t t_us = static_cast<uint32_t>(now_us);
    if (change != 0) {
      // The time between two ticks of opposite direction does not measure speed: the wheel stopped
      // in between.
      if (sign(change) != direction_) reset();
      direction_ = sign(change);
      if (silence_us_ > 0 && follows_a_pause()) marks_.clear();
      newest_ = {newest_.ticks + static_cast<uint32_t>(change), t_us, behind_q4};
    }
    if (direction_ == 0) return;
    silence_us_ = t_us - newest_.t_us;
    if (silence_us_ >= kStandstill_us) return reset();
    note(t_us, window_us);
    // A tick that is overdue by half a period means that the wheel has slowed down: until it comes,
    // the speed is at most 1.5 ticks in the time since the last one.
    const int32_t limit_q8 =
        silence_us_ > 0 ? static_cast<int32_t>(384'000'000u / silence_us_) : INT32_MAX;
    if (magnitude(rate_q8_) < limit_q8) {
      drop_old(t_us, window_us, period_us * kFineSteps < window_us);
      measure();
    }
    rate_q8_ = clamp(rate_q8_, -limit_q8, limit_q8);
  }
  void reset() {
    marks_.clear();
    direction_ = 0;
    cycle_us_ = 0;
    baseline_ = {};
    rate_q8_ = 0;
    falling_behind_umps_ = 0;
  }

  /// Ticks per second x 256, forward positive.
  int32_t ticks_per_s_q8() const { return rate_q8_; }
  /// No tick came for half a second, or none yet. A speed of 0 alone says less: a wheel that turns
  /// back, or was just pushed, has one for a moment.
  bool is_still() const { return direction_ == 0; }
  /// How fast the wheel is falling behind, um/s, over the same interval as the velocity: so the lag
  /// of the measurement is not mistaken for an error while the setpoint ramps.
  int32_t falling_behind_umps() const { return falling_behind_umps_; }

 private:
  // A wheel without a tick for this long is at rest.
  static constexpr uint32_t kStandstill_us = 500'000;

  // Dithers the spacing of the marks; see note().
  static constexpr uint32_t kGoldenRatio_q16 = 40'503;

  // A whole cycle of A and B, in ticks. Its four edges are unevenly spaced, whole cycles are not.
  static constexpr int32_t kCycle = 4;

  // With this many control steps in a window, the step in which a tick was seen dates it well
  // enough.
  static constexpr uint32_t kFineSteps = 16;

  // A tick that comes after this many tick periods ends a pause: the earlier ones no longer say
  // anything about the speed.
  static constexpr uint32_t kPeriodsOfAPause = 4;

  static constexpr uint32_t kMarksPerWindow = 6;
  /// Longest baseline while waiting for a whole cycle of ticks, in windows.
  static constexpr uint32_t kMaxWindows = 4;
  static constexpr uint32_t kMarks = kMarksPerWindow * kMaxWindows;

  static Tick since(const Tick& before, const Tick& after) {
    return {after.ticks - before.ticks, after.t_us - before.t_us,
            after.behind_q4 - before.behind_q4};
  }
  bool follows_a_pause() const {
    const auto ticks = static_cast<uint32_t>(magnitude(static_cast<int32_t>(baseline_.ticks)));
    return static_cast<uint64_t>(silence_us_) * ticks >
           static_cast<uint64_t>(kPeriodsOfAPause) * baseline_.t_us;
  }
  /// Takes a mark at times that do not depend on ticks: kMarks of them span kMaxWindows windows.
  void note(uint32_t t_us, uint32_t window_us) {
    if (marks_.size() > 0 && t_us - marks_[marks_.size() - 1].noted_us < spacing_us_) return;
    // Evenly spaced marks could lock into the ratio of ticks to steps themselves. Dithered by
    // multiples of the golden ratio, the number worst approximated by fractions, they cannot.
    dither_q16_ = static_cast<uint16_t>(dither_q16_ + kGoldenRatio_q16);
    const uint32_t even_us = window_us / kMarksPerWindow;
    spacing_us_ = even_us / 2 + (even_us * dither_q16_ >> 16);
    marks_.push() = {newest_, t_us};
  }
  /// Drops marks that are too old, so that the baseline begins about a window ago.
  void drop_old(uint32_t t_us, uint32_t window_us, bool fine) {
    const uint32_t least_us = window_us - window_us / (2 * kMarksPerWindow);
    while (marks_.size() > 2) {
      const Mark& next = marks_[2];
      const uint32_t age_us = t_us - next.noted_us;
      if (age_us < least_us) return;
      const int32_t ticks = magnitude(static_cast<int32_t>(newest_.ticks - next.newest.ticks));
      // If steps are coarse, require one more tick before shortening the baseline, so that at
      // constant speed its length is constant. A length chosen by the ticks that happen to be in it
      // would be biased: short baselines would be those with many ticks.
      const int32_t needed = fine || age_us >= cycle_us_ ? kCycle : kCycle + 1;
      if (ticks < needed && age_us < kMaxWindows * window_us) {
        if (cycle_us_ <= age_us) cycle_us_ = age_us + 1;
        return;
      }
      if (cycle_us_ > age_us) cycle_us_ = age_us;
      marks_.drop_oldest();
    }
  }
  /// The mean of two baselines, one mark apart, so that a tick seen late has half the weight.
  void measure() {
    Tick sum = since(marks_[0].newest, newest_);
    if (marks_.size() > 2) {
      const Tick later = since(marks_[1].newest, newest_);
      const Tick earlier = since(marks_[0].newest, marks_[marks_.size() - 2].newest);
      sum = {later.ticks + earlier.ticks, later.t_us + earlier.t_us,
             later.behind_q4 + earlier.behind_q4};
    }
    if (sum.t_us == 0) return;
    baseline_ = sum;
    // The one division: 32 bits, which RV32 has in hardware.
    const uint32_t per_s_q12 = 4'096'000'000u / sum.t_us;
    rate_q8_ = saturate32((static_cast<int64_t>(static_cast<int32_t>(sum.ticks)) * per_s_q12) >> 4);
    falling_behind_umps_ =
        saturate32((static_cast<int64_t>(static_cast<int32_t>(sum.behind_q4)) * per_s_q12) >> 16);
  }

  Ring<Mark, kMarks> marks_;
  Tick newest_{};
  int32_t direction_ = 0;    // 0: at rest
  uint32_t spacing_us_ = 0;  // To the next mark.
  uint16_t dither_q16_ = 0;
  uint32_t cycle_us_ = 0;    // Age that a mark needs for a whole cycle of ticks since.
  uint32_t silence_us_ = 0;  // Time without a tick, at the last step.
  Tick baseline_{};          // The latest measurement: ticks, and the time that they took.
  int32_t rate_q8_ = 0;
  int32_t falling_behind_umps_ = 0;
};

}  // namespace wheelwire
