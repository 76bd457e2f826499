// What the bench measures, one function for each row of the table in docs/testing.md. Each returns
// its results as a JSON object; what passes is decided by tests/support/hil.py.
#pragma once

#include <cstdint>
#include <string>

namespace wheelwire::hil {

constexpr int64_t kDriveUs = 200'000;  ///< After a start: from here on the chip drives.
constexpr int16_t kDuty_q15 = 3000;    ///< So much.

/// `times`: 1, or 10 for a long run.
std::string measure_crashes(int times);
std::string measure_pwm(int times);
std::string measure_counters(int times);
std::string measure_stops(int times);
std::string measure_line(int times);

}  // namespace wheelwire::hil
