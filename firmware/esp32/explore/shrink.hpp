// The shortest scenario that still breaks the same rule.
#pragma once

#include "operation.hpp"
#include "rule_ids.hpp"

namespace wheelwire::explore {

/// What a scenario came to.
struct Outcome {
  Finding finding;        ///< Its text is empty if no rule is broken.
  size_t operations = 0;  ///< How many were carried out.
  double seconds = 0.0;   ///< Of the robot's time.
  bool found() const { return !finding.text.empty(); }
};

class Coverage;

Outcome carry_out(const Scenario& scenario, Coverage& coverage);

/// Leaves out operations, and shortens times and rounds numbers, for at most so many seconds.
Scenario shrink(const Scenario& scenario, Rule rule, double seconds);

}  // namespace wheelwire::explore
