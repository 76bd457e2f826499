// How fast a command may change, and how large it may be.
#pragma once

#include "fixed.hpp"
#include "path.hpp"

namespace wheelwire {

/// value * part / whole, for |part| <= |whole|.
inline int32_t proportion(int32_t value, int32_t part, int32_t whole) {
  return static_cast<int32_t>(static_cast<int64_t>(value) * part / whole);
}

/// a - b, saturated symmetrically.
inline int32_t difference(int32_t a, int32_t b) {
  int32_t result;
  if (__builtin_sub_overflow(a, b, &result)) return a < b ? -INT32_MAX : INT32_MAX;
  return greater(result, -INT32_MAX);
}

/// Both scaled by the same factor, so that neither exceeds the limit and the path keeps its
/// curvature.
inline WheelPair scale_to_limit(WheelPair target, int32_t limit) {
  const int32_t peak = greater(magnitude(target.left), magnitude(target.right));
  if (peak <= limit) return target;
  return {proportion(target.left, limit, peak), proportion(target.right, limit, peak)};
}

/// One slew-limited step from `from` towards `to`: both wheels arrive at the same time.
inline WheelPair approach(WheelPair from, WheelPair to, int32_t max_step) {
  const int32_t left = difference(to.left, from.left);
  const int32_t right = difference(to.right, from.right);
  const int32_t peak = greater(magnitude(left), magnitude(right));
  if (peak <= max_step) return to;
  return {from.left + proportion(left, max_step, peak),
          from.right + proportion(right, max_step, peak)};
}

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
