// Generates a scenario from a seed.
#pragma once

#include "operation.hpp"

namespace wheelwire::explore {

/// The same seed gives the same scenario, on every machine.
Scenario generate(uint64_t seed);

}  // namespace wheelwire::explore
