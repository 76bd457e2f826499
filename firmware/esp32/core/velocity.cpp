#include "velocity.hpp"

#include "fixed.hpp"

namespace wheelwire {
namespace {

// Without a tick for this long the wheel stands.
constexpr uint32_t kStandstill_us = 500'000;

// A whole cycle of A and B: its four edges are not equally far apart, a cycle and the next one are.
constexpr uint32_t kCycle = 4;

// A baseline of a whole cycle is worth waiting for, up to this many windows.
constexpr uint32_t kPatience = 4;

/// ticks / t_us in ticks per second x 256. One 32-bit division, which RV32 has in hardware.
int32_t rate_q8(int32_t ticks, uint32_t t_us) {
  const uint32_t per_s_q12 = 4'096'000'000u / t_us;
  return saturate32((static_cast<int64_t>(ticks) * per_s_q12) >> 4);
}

}  // namespace

void VelocityEstimator::reset() {
  count_ = 0;
  direction_ = 0;
  rate_q8_ = 0;
}

void VelocityEstimator::update(int32_t change, uint64_t now_us, uint32_t window_us) {
  const uint32_t t_us = static_cast<uint32_t>(now_us);
  if (change == 0) {
    if (count_ > 0) bound(t_us - latest_.t_us);
    return;
  }
  // The time between two ticks of opposite direction says nothing about speed.
  if (sign(change) != direction_) reset();
  direction_ = sign(change);
  latest_ = {latest_.ticks + static_cast<uint32_t>(change), t_us};
  measure(window_us);
  add_mark(window_us);
}

/// Marks are kept apart so that kMarks of them span two windows at any speed.
void VelocityEstimator::add_mark(uint32_t window_us) {
  if (count_ > 0 && latest_.t_us - mark(count_ - 1).t_us < window_us / (kMarks / 2)) return;
  if (count_ == kMarks) {
    first_ = (first_ + 1) % kMarks;
    --count_;
  }
  marks_[(first_ + count_) % kMarks] = latest_;
  ++count_;
}

void VelocityEstimator::measure(uint32_t window_us) {
  while (count_ > 1) {
    const uint32_t age_us = latest_.t_us - mark(1).t_us;
    const auto ticks = static_cast<int32_t>(latest_.ticks - mark(1).ticks);
    const bool whole_cycle = magnitude(ticks) >= static_cast<int32_t>(kCycle);
    if (age_us < window_us || (!whole_cycle && age_us < kPatience * window_us)) break;
    first_ = (first_ + 1) % kMarks;
    --count_;
  }
  if (count_ == 0 || latest_.t_us == mark(0).t_us) return;
  const Mark& base = mark(0);
  rate_q8_ = rate_q8(static_cast<int32_t>(latest_.ticks - base.ticks), latest_.t_us - base.t_us);
}

/// A tick that has not come after 1.5 of its periods says that the wheel has slowed.
void VelocityEstimator::bound(uint32_t silence_us) {
  if (silence_us >= kStandstill_us) {
    reset();
    return;
  }
  if (silence_us == 0) return;
  const int32_t limit_q8 = static_cast<int32_t>(384'000'000u / silence_us);
  rate_q8_ = clamp(rate_q8_, -limit_q8, limit_q8);
}

}  // namespace wheelwire
