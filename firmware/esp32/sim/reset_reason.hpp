// Reset reasons by number and by name, as they come from outside.
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

}  // namespace wheelwire::sim
