// Measures what `make hil` measures on a board, over main/*.cpp on the stand-ins, in virtual time.
// Prints one JSON object. The argument multiplies how often.
#include <cstdio>
#include <cstdlib>

#include "rows.hpp"

int main(int count, char** arguments) {
  const int times = count > 1 ? std::atoi(arguments[1]) : 1;
  if (times < 1) {
    std::fputs("usage: wheelwire-hil-sim [TIMES]\n", stderr);
    return 2;
  }
  using namespace wheelwire::hil;
  std::printf("{\"crashes\": %s,\n", measure_crashes(times).c_str());
  std::printf("\"pwm\": %s,\n", measure_pwm(times).c_str());
  std::printf("\"counters\": %s,\n", measure_counters(times).c_str());
  std::printf("\"stops\": %s,\n", measure_stops(times).c_str());
  std::printf("\"line\": %s}\n", measure_line(times).c_str());
  return 0;
}
