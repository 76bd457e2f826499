#include "slew.hpp"

namespace wheelwire {
namespace {

/// value * part / whole, for |part| <= |whole|.
int32_t proportion(int32_t value, int32_t part, int32_t whole) {
  return static_cast<int32_t>(static_cast<int64_t>(value) * part / whole);
}

/// a - b, saturated symmetrically.
int32_t difference(int32_t a, int32_t b) {
  int32_t result;
  if (__builtin_sub_overflow(a, b, &result)) return a < b ? -INT32_MAX : INT32_MAX;
  return greater(result, -INT32_MAX);
}

}  // namespace

WheelPair scale_to_limit(WheelPair target, int32_t limit) {
  const int32_t peak = greater(magnitude(target.left), magnitude(target.right));
  if (peak <= limit) return target;
  return {proportion(target.left, limit, peak), proportion(target.right, limit, peak)};
}

WheelPair approach(WheelPair from, WheelPair to, int32_t max_step) {
  const int32_t left = difference(to.left, from.left);
  const int32_t right = difference(to.right, from.right);
  const int32_t peak = greater(magnitude(left), magnitude(right));
  if (peak <= max_step) return to;
  return {from.left + proportion(left, max_step, peak),
          from.right + proportion(right, max_step, peak)};
}

}  // namespace wheelwire
