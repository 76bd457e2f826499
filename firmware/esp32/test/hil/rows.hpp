// What the bench measures, one function for each row of the table in docs/testing.md. Each returns
// its results as a JSON object; what passes is decided by tests/support/hil.py.
#pragma once

#include <string>

namespace wheelwire::hil {

/// `times`: 1, or 10 for a long run.
std::string measure_crashes(int times);
std::string measure_pwm(int times);
std::string measure_counters(int times);
std::string measure_stops(int times);
std::string measure_line(int times);

}  // namespace wheelwire::hil
