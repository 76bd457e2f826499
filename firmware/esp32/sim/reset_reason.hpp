// Reset reasons by number and by name, as they come from outside, and what they do.
#pragma once

#include <array>
#include <string_view>

#include "protocol.hpp"

namespace wheelwire::sim {

/// Indexed by ResetReason.
constexpr std::array<std::string_view, 8> kResetReasonNames = {
    "unknown", "power_on",      "external",           "software",
    "panic",   "task_watchdog", "interrupt_watchdog", "brownout"};
static_assert(static_cast<size_t>(ResetReason::kBrownout) + 1 == kResetReasonNames.size());

/// Whether the memory that a reset of the processor leaves alone is lost: with the power, and with
/// the reset pin, which resets the whole chip.
constexpr bool loses_memory(ResetReason reason) {
  return reason == ResetReason::kPowerOn || reason == ResetReason::kBrownout ||
         reason == ResetReason::kExternal;
}

}  // namespace wheelwire::sim
