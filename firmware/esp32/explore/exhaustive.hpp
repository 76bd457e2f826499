// The small spaces, visited as a whole: states x messages x contact x board x trial x store.
#pragma once

#include <vector>

#include "operation.hpp"

namespace wheelwire::explore {

/// A short scenario for each combination that can be reached.
std::vector<Scenario> all_combinations();

}  // namespace wheelwire::explore
