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

/// The part of the errors `behind` [um] that is still to be corrected. All of it is dropped when
/// the setpoint changes direction, the common part when a wheel saturates, and what exceeds the
/// limit in any case: an error that cannot be corrected soon would only wind up.
WheelPair trim_errors(WheelPair behind, WheelPair setpoint, bool same_direction, bool saturated,
                      const PathGains& gains);

/// The setpoint plus what corrects the errors, by cross-coupled control: the wheel that is ahead
/// waits for the other one, which keeps the heading. After Borenstein and Koren, "Motion
/// control analysis of a mobile robot", Journal of Dynamic Systems, Measurement, and Control 109
/// (1987).
WheelPair correct_setpoint(WheelPair setpoint, WheelPair behind, const PathGains& gains);

}  // namespace wheelwire
