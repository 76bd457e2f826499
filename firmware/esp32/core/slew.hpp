// How fast a command may change, and how large it may be.
#pragma once

#include "fixed.hpp"
#include "path.hpp"

namespace wheelwire {

/// Both scaled by the same factor, so that neither exceeds the limit and the path keeps its
/// curvature.
WheelPair scale_to_limit(WheelPair target, int32_t limit);

/// One slew-limited step from `from` towards `to`: both wheels arrive at the same time.
WheelPair approach(WheelPair from, WheelPair to, int32_t max_step);

/// As `approach`, of one wheel alone.
inline int32_t step_towards(int32_t from, int32_t wanted, int32_t max_step) {
  // Not by 64-bit sums: they take ten times as many instructions.
  int32_t low;
  int32_t high;
  if (__builtin_sub_overflow(from, max_step, &low)) low = -INT32_MAX;
  if (__builtin_add_overflow(from, max_step, &high)) high = INT32_MAX;
  return clamp(wanted, low, high);
}

/// `slewed`, or one step towards the limit where a lowered one leaves the output above it.
inline int32_t towards_limit(int32_t slewed, int32_t before, int32_t limit, int32_t max_step) {
  if (magnitude(slewed) <= limit) return slewed;
  return step_towards(before, clamp(slewed, -limit, limit), max_step);
}

}  // namespace wheelwire
