#include "path.hpp"

namespace wheelwire {
namespace {

/// Bounded so that a correction never reverses a wheel, nor makes it much faster than its setpoint.
int32_t corrected(int32_t setpoint, int32_t correction, const PathGains& gains) {
  const int32_t most = scale(magnitude(setpoint), gains.catch_up_q15, 15);
  return setpoint >= 0 ? setpoint + clamp(correction, -setpoint, most)
                       : setpoint + clamp(correction, -most, -setpoint);
}

}  // namespace

WheelPair trim_errors(WheelPair behind, bool same_direction, bool saturated,
                      const PathGains& gains) {
  if (!same_direction) return {0, 0};
  if (saturated) {
    // A wheel at its limit cannot catch up, so the lost distance is dropped. The difference is
    // kept: the other wheel can wait, and the heading is kept.
    const int32_t common = (behind.left + behind.right) / 2;
    behind = {behind.left - common, behind.right - common};
  }
  return {clamp(behind.left, -gains.limit_um, gains.limit_um),
          clamp(behind.right, -gains.limit_um, gains.limit_um)};
}

WheelPair correct_setpoint(WheelPair setpoint, WheelPair behind, const PathGains& gains) {
  const int32_t turn = scale(behind.left - behind.right, gains.heading_q16, 16);
  const int32_t left = scale(behind.left, gains.path_q16, 16);
  const int32_t right = scale(behind.right, gains.path_q16, 16);
  return {corrected(setpoint.left, left + turn, gains),
          corrected(setpoint.right, right - turn, gains)};
}

}  // namespace wheelwire
