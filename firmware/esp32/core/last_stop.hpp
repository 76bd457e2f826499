// What ended the last motion: the part that outlasts a reset.
#pragma once

#include <string.h>

#include "protocol.hpp"

namespace wheelwire {

/// Saved as its bytes in memory, for the same chip: so it has no padding.
struct LastStop {
  uint32_t held = 0;       ///< The sensors that held the robot, as flags of `held`.
  uint32_t session = 0;    ///< Whose setpoint drove until then,
  uint32_t command = 0;    ///< and its number.
  uint16_t faults = 0;     ///< Latched at it.
  uint16_t mmps = 0;       ///< Of the faster wheel.
  uint16_t rolled_mm = 0;  ///< Of that wheel, since.
  StopCause cause = StopCause::kUnknown;
  ResetReason reset = ResetReason::kUnknown;
  uint8_t flags = 0;  ///< Flags of `stopflag`.
  uint8_t unused[3]{};

  bool operator==(const LastStop& other) const { return memcmp(this, &other, kSize) == 0; }
  bool is_over() const { return (flags & stopflag::kAtRest) != 0; }

  static constexpr size_t kSize = 24;
};
static_assert(sizeof(LastStop) == LastStop::kSize);

}  // namespace wheelwire
