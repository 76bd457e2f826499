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
              uint32_t window_us);
  void reset();

  /// Ticks per second x 256, forward positive.
  int32_t ticks_per_s_q8() const { return rate_q8_; }
  /// No tick came for half a second, or none yet. A speed of 0 alone says less: a wheel that turns
  /// back, or was just pushed, has one for a moment.
  bool is_still() const { return direction_ == 0; }
  /// How fast the wheel is falling behind, um/s, over the same interval as the velocity: so the lag
  /// of the measurement is not mistaken for an error while the setpoint ramps.
  int32_t falling_behind_umps() const { return falling_behind_umps_; }

 private:
  static constexpr uint32_t kMarksPerWindow = 6;
  /// Longest baseline while waiting for a whole cycle of ticks, in windows.
  static constexpr uint32_t kMaxWindows = 4;
  static constexpr uint32_t kMarks = kMarksPerWindow * kMaxWindows;

  static Tick since(const Tick& before, const Tick& after) {
    return {after.ticks - before.ticks, after.t_us - before.t_us,
            after.behind_q4 - before.behind_q4};
  }
  bool follows_a_pause() const;
  void note(uint32_t t_us, uint32_t window_us);
  void drop_old(uint32_t t_us, uint32_t window_us, bool fine);
  void measure();

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
