// Error and noise of the measured velocity at each speed: bench/velocity.py plots them.
//
// An ideal encoder at constant speed, control steps at the rate that the argument gives in Hz (1000
// by default), 3 s at each of 100 phases between ticks and steps. Prints, as CSV, counts per turn,
// m/s, and for the estimator and for a simple one: error of the mean and standard
// deviation, as fractions of the speed.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>

#include "tick_to_tick.hpp"
#include "velocity.hpp"

namespace {

using wheelwire::VelocityEstimator;
using namespace wheelwire::sim;

constexpr uint32_t kWindow_us = 20'000;
constexpr double kWheelRadius_m = 0.033;
constexpr int kPhases = 100;
constexpr double kWarmUp_s = 0.5;
constexpr double kMeasured_s = 3.0;
constexpr long kLowest_hz = 100;
constexpr long kHighest_hz = 5000;

struct Figures {
  double sum = 0.0;
  double squares = 0.0;
  int count = 0;

  void add(double error) {
    sum += error;
    squares += error * error;
    ++count;
  }
  double mean() const { return sum / count; }
  double noise() const { return std::sqrt(squares / count - mean() * mean()); }
};

void measure(double counts_per_turn, double mps, long rate_hz) {
  const int warm_up_steps = static_cast<int>(kWarmUp_s * static_cast<double>(rate_hz));
  const int steps = warm_up_steps + static_cast<int>(kMeasured_s * static_cast<double>(rate_hz));
  const double ticks_per_s = mps * counts_per_turn / (2.0 * std::numbers::pi * kWheelRadius_m);
  const auto period_us = static_cast<uint32_t>(1'000'000 / rate_hz);
  Figures ours;
  Figures obvious;
  for (int phase = 0; phase < kPhases; ++phase) {
    VelocityEstimator estimator;
    TickToTick beside;
    int64_t counted = 0;
    for (int step = 1; step <= steps; ++step) {
      const double seconds = static_cast<double>(step) / static_cast<double>(rate_hz);
      const double way = static_cast<double>(phase) / kPhases + ticks_per_s * seconds;
      const auto position = static_cast<int64_t>(std::floor(way));
      const auto change = static_cast<int32_t>(position - counted);
      const auto t_us = static_cast<uint64_t>(std::llround(seconds * 1e6));
      counted = position;
      estimator.update(change, 0, t_us, period_us, kWindow_us);
      beside.update(change, t_us, kWindow_us);
      if (step <= warm_up_steps) continue;
      ours.add(estimator.ticks_per_s_q8() / 256.0 / ticks_per_s - 1.0);
      obvious.add(beside.ticks_per_s() / ticks_per_s - 1.0);
    }
  }
  std::printf("%.0f,%.4f,%.6f,%.6f,%.6f,%.6f\n", counts_per_turn, mps, ours.mean(), ours.noise(),
              obvious.mean(), obvious.noise());
}

}  // namespace

int main(int argc, char** argv) {
  const long rate_hz = argc > 1 ? std::strtol(argv[1], nullptr, 10) : 1000;
  if (argc > 2 || rate_hz < kLowest_hz || rate_hz > kHighest_hz) {
    std::fprintf(stderr, "usage: %s [control rate, %ld to %ld Hz]\n", argv[0], kLowest_hz,
                 kHighest_hz);
    return 2;
  }
  std::puts("counts_per_revolution,mps,mean_error,noise,obvious_mean_error,obvious_noise");
  for (const double counts : {360.0, 1440.0}) {
    for (const double direction : {-1.0, 1.0}) {
      for (int step = 0; step <= 290; ++step)
        measure(counts, direction * (0.02 + 0.002 * step), rate_hz);
    }
  }
}
