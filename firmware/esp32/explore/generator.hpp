// From a seed to a scenario.
#pragma once

#include "operation.hpp"

namespace wheelwire::explore {

/// The same seed gives the same scenario, on every machine.
Scenario generate(uint64_t seed);

}  // namespace wheelwire::explore
