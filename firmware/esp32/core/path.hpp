// Path following: each wheel makes up its following error, and waits for the other one.
#pragma once

#include <stdint.h>

#include "fixed.hpp"

namespace wheelwire {

/// A value for each wheel.
struct WheelPair {
  int32_t left;
  int32_t right;
};

struct PathGains {
  int32_t path_q16;      ///< um/s for each um that a wheel is behind.
  int32_t heading_q16;   ///< um/s for either wheel, for each um that one is further behind than the
                         ///< other.
  int32_t catch_up_q15;  ///< How much faster than its setpoint a wheel may turn.
  int32_t limit_um;      ///< No wheel makes up more than this.

  bool follows() const { return path_q16 != 0 || heading_q16 != 0; }
};

/// The part of the errors `behind` [um] that is still to be made up. All of it is dropped when the
/// setpoint changes its direction, the common part when a wheel saturates, and what exceeds the
/// limit in any case: an error that cannot be made up soon would only wind up.
WheelPair remember(WheelPair behind, bool same_direction, bool saturated, const PathGains& gains);

/// The velocities that make up for the errors, in cross-coupled control: the wheel that is ahead
/// waits for the other one, so that the heading holds. After Borenstein and Koren, "Motion control
/// analysis of a mobile robot", Journal of Dynamic Systems, Measurement, and Control 109 (1987).
WheelPair make_up(WheelPair setpoint, WheelPair behind, const PathGains& gains);

}  // namespace wheelwire
