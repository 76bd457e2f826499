// Which wheels are being driven, for the dead-man: written by the control task, read by interrupts.
#pragma once

#include <stdint.h>

#include <atomic>

namespace wheelwire {

/// A bit for each wheel whose outputs do more than brake or coast, or are not known yet. It is set
/// before the pins move and cleared after they stand still, so that a step that hangs in between
/// counts as driving.
inline std::atomic<uint32_t> moving_wheels{3};

inline void note_moving(uint32_t wheel) { moving_wheels.fetch_or(1u << wheel); }
inline void note_still(uint32_t wheel) { moving_wheels.fetch_and(~(1u << wheel)); }

}  // namespace wheelwire
