// Wheel velocity from ticks and the time between them.
//
// Ticks per control period are 0 or 1 at low speed: at 0.03 m/s and 360 counts a turn a tick comes
// every 19 ms. So velocity is measured from one tick to another, some time apart, and while the
// next tick does not come it is bounded by that.
//
// A tick is seen up to one control period late, by an amount that depends on the ratio of ticks to
// steps. So that it cancels in the mean at every speed, both ends of the measurement are chosen in
// the same way, at every step: the newest tick that is known now, and the one that was the newest a
// window ago. Choosing either end by when its tick was seen makes the mean wrong by up to 1.6 %,
// and choosing the length by the ticks of the moment by up to 3.3 % at 100 control steps a second.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire {

class VelocityEstimator {
 public:
  /// Call at every control step with the ticks since the last call, and with how far the wheel is
  /// behind its setpoint, um x 16 (modulo 2^32).
  void update(int32_t change, uint32_t behind_q4, uint64_t now_us, uint32_t period_us,
              uint32_t window_us);
  void reset();

  /// Ticks per second x 256, forward positive.
  int32_t ticks_per_s_q8() const { return rate_q8_; }
  /// How fast the wheel falls behind, um/s, over the very time in which velocity was measured: so a
  /// ramp of the setpoint is not taken for an error because the measurement is late.
  int32_t falling_behind_umps() const { return falling_behind_umps_; }

 private:
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
  static constexpr uint32_t kMarksPerWindow = 6;
  /// The longest that a baseline may become while it waits for a whole cycle of ticks, in windows.
  static constexpr uint32_t kMaxWindows = 4;
  static constexpr size_t kMarks = kMarksPerWindow * kMaxWindows;

  static Tick since(const Tick& before, const Tick& after) {
    return {after.ticks - before.ticks, after.t_us - before.t_us,
            after.behind_q4 - before.behind_q4};
  }
  bool follows_a_pause() const;
  void note(uint32_t t_us, uint32_t window_us);
  void drop_old(uint32_t t_us, uint32_t window_us, bool fine);
  void measure();
  const Mark& mark(size_t index) const {
    const size_t slot = first_ + index;
    return marks_[slot < kMarks ? slot : slot - kMarks];
  }

  Mark marks_[kMarks];  // oldest first, from first_
  size_t first_ = 0;
  size_t count_ = 0;
  Tick newest_{};
  int32_t direction_ = 0;    // 0: stands
  uint32_t spacing_us_ = 0;  // To the next mark.
  uint16_t dither_q16_ = 0;
  uint32_t cycle_us_ = 0;    // How old a mark must be for a whole cycle since then.
  uint32_t silence_us_ = 0;  // Without a tick, at the last step.
  Tick baseline_{};          // What was measured last: so many ticks in that time.
  int32_t rate_q8_ = 0;
  int32_t falling_behind_umps_ = 0;
};

}  // namespace wheelwire
