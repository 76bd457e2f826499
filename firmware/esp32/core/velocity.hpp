// Wheel velocity from ticks and the time between them.
//
// Ticks per control period are 0 or 1 at low speed: at 0.03 m/s and 360 counts a turn a tick comes
// every 19 ms. So velocity is measured from one tick to another, some time apart, and while the
// next tick does not come it is bounded by that.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire {

class VelocityEstimator {
 public:
  /// Call at every control step with the ticks since the last call.
  void update(int32_t change, uint64_t now_us, uint32_t window_us);
  void reset();

  /// Ticks per second x 256, forward positive.
  int32_t ticks_per_s_q8() const { return rate_q8_; }

 private:
  struct Mark {
    uint32_t ticks;
    uint32_t t_us;
  };
  static constexpr size_t kMarks = 32;

  void add_mark(uint32_t window_us);
  void measure(uint32_t window_us);
  void bound(uint32_t silence_us);
  const Mark& mark(size_t index) const { return marks_[(first_ + index) % kMarks]; }

  Mark marks_[kMarks];  // oldest first, from first_
  size_t first_ = 0;
  size_t count_ = 0;
  Mark latest_{};
  int32_t direction_ = 0;
  int32_t rate_q8_ = 0;
};

}  // namespace wheelwire
