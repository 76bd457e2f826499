// The path: what either wheel makes up of what it is behind, and what it waits for the other.
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
  int32_t heading_q16;   ///< um/s for either wheel, for each um that one is behind more.
  int32_t catch_up_q15;  ///< How much faster than its setpoint a wheel may turn.
  int32_t limit_um;      ///< No wheel makes up more than this.

  bool follows() const { return path_q16 != 0 || heading_q16 != 0; }
};

/// What is left of the errors `behind` [um] once what must be forgotten is.
WheelPair remember(WheelPair behind, bool same_direction, bool saturated, const PathGains& gains);

/// The velocities that make up for the errors, in cross-coupled control: the wheel that is ahead
/// waits for the other one, so that the heading holds. After Borenstein and Koren, "Motion control
/// analysis of a mobile robot", Journal of Dynamic Systems, Measurement, and Control 109 (1987).
WheelPair make_up(WheelPair setpoint, WheelPair behind, const PathGains& gains);

}  // namespace wheelwire
