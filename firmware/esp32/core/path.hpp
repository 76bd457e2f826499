// Path following: each wheel corrects its following error, and the one ahead waits for the other.
#pragma once

#include <stdint.h>

#include "fixed.hpp"

namespace wheelwire {

/// A value for each wheel.
struct WheelPair {
  int32_t left;
  int32_t right;

  constexpr bool is_zero() const { return left == 0 && right == 0; }
};

struct PathGains {
  int32_t path_q16;      ///< um/s for each um that a wheel is behind.
  int32_t heading_q16;   ///< um/s at either wheel, for each um that one is further behind than the
                         ///< other.
  int32_t catch_up_q15;  ///< How much faster than its setpoint a wheel may turn.
  int32_t limit_um;      ///< The largest error that is corrected.

  bool follows() const { return path_q16 != 0 || heading_q16 != 0; }
};

/// Bounded so that a correction never reverses a wheel, or makes it much faster than its setpoint.
inline int32_t corrected(int32_t setpoint, int32_t correction, const PathGains& gains) {
  const int32_t most = scale(magnitude(setpoint), gains.catch_up_q15, 15);
  return setpoint >= 0 ? setpoint + clamp(correction, -setpoint, most)
                       : setpoint + clamp(correction, -most, -setpoint);
}

/// The left wheel's share of the distance that both lose when the robot is late: by the setpoints,
/// so that a curve stays the same curve. q8.
inline int32_t left_share_q8(WheelPair setpoint) {
  if (sign(setpoint.left) != sign(setpoint.right)) return 128;
  const auto left = static_cast<uint32_t>(magnitude(setpoint.left));
  return static_cast<int32_t>((left << 8) /
                              (left + static_cast<uint32_t>(magnitude(setpoint.right))));
}

/// The part of the errors `behind` [um] that is still to be corrected. All of it is dropped when
/// the setpoint changes direction, the common part when a wheel saturates, and what exceeds the
/// limit in any case: an error that cannot be corrected soon would only wind up.
inline WheelPair trim_errors(WheelPair behind, WheelPair setpoint, bool same_direction,
                             bool saturated, const PathGains& gains) {
  if (!same_direction) return {0, 0};
  if (saturated) {
    // A wheel at its limit cannot catch up, so the lost distance is dropped, but not what leads
    // off the path: the other wheel can wait, which keeps the heading.
    const int32_t common = behind.left + behind.right;
    const int32_t left = scale(common, left_share_q8(setpoint), 8);
    behind = {behind.left - left, behind.right - (common - left)};
  }
  return {clamp(behind.left, -gains.limit_um, gains.limit_um),
          clamp(behind.right, -gains.limit_um, gains.limit_um)};
}

/// The setpoint plus what corrects the errors, by cross-coupled control: the wheel that is ahead
/// waits for the other one, which keeps the heading. After Borenstein and Koren, "Motion
/// control analysis of a mobile robot", Journal of Dynamic Systems, Measurement, and Control 109
/// (1987).
inline WheelPair correct_setpoint(WheelPair setpoint, WheelPair behind, const PathGains& gains) {
  const int32_t turn = scale(behind.left - behind.right, gains.heading_q16, 16);
  const int32_t left = scale(behind.left, gains.path_q16, 16);
  const int32_t right = scale(behind.right, gains.path_q16, 16);
  return {corrected(setpoint.left, left + turn, gains),
          corrected(setpoint.right, right - turn, gains)};
}

}  // namespace wheelwire
