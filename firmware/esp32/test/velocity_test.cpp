#include "velocity.hpp"

#include <algorithm>
#include <cmath>

#include "fixed.hpp"
#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr uint32_t kWindow_us = 20'000;

/// Feeds a wheel turning at `ticks_per_s` for `seconds`; returns the extremes of the last half.
struct Extremes {
  double least = 1e9;
  double most = -1e9;
};

Extremes turn(VelocityEstimator& estimator, double ticks_per_s, double seconds) {
  Extremes seen;
  int64_t counted = 0;
  const auto steps = static_cast<int>(seconds * 1000);
  for (int step = 1; step <= steps; ++step) {
    const auto position = static_cast<int64_t>(std::floor(ticks_per_s * step / 1000.0));
    estimator.update(static_cast<int32_t>(position - counted), 0,
                     static_cast<uint64_t>(step) * 1000, kPeriod_us, kWindow_us);
    counted = position;
    if (step < steps / 2) continue;
    seen.least = std::min(seen.least, estimator.ticks_per_s_q8() / 256.0);
    seen.most = std::max(seen.most, estimator.ticks_per_s_q8() / 256.0);
  }
  return seen;
}

/// Error of the mean over 3 s and 25 phases, as a fraction.
double mean_error(double ticks_per_s, int rate_hz = 1000) {
  double sum = 0.0;
  for (int phase = 0; phase < 25; ++phase) {
    VelocityEstimator estimator;
    int64_t counted = 0;
    for (int step = 1; step <= rate_hz * 7 / 2; ++step) {
      const auto position =
          static_cast<int64_t>(std::floor(phase / 25.0 + ticks_per_s * step / rate_hz));
      estimator.update(static_cast<int32_t>(position - counted), 0,
                       static_cast<uint64_t>(step * 1'000'000LL / rate_hz),
                       static_cast<uint32_t>(1'000'000 / rate_hz), kWindow_us);
      counted = position;
      if (step > rate_hz / 2) sum += estimator.ticks_per_s_q8() / 256.0;
    }
  }
  return sum / (25 * 3 * rate_hz) / ticks_per_s - 1.0;
}

void check_steady(double ticks_per_s, double tolerance) {
  VelocityEstimator estimator;
  const Extremes seen = turn(estimator, ticks_per_s, 2.0);
  CHECK(seen.least > ticks_per_s - std::abs(ticks_per_s) * tolerance);
  CHECK(seen.most < ticks_per_s + std::abs(ticks_per_s) * tolerance);
}

}  // namespace

TEST(velocity_is_smooth_where_ticks_are_rare) { check_steady(52, 0.03); }
TEST(velocity_at_walking_pace) { check_steady(700, 0.07); }
TEST(velocity_with_many_ticks_a_period) { check_steady(250'000, 0.01); }
TEST(velocity_backwards) { check_steady(-300, 0.07); }

TEST(the_mean_is_right_at_every_ratio_of_ticks_to_steps) {
  for (const double per_turn : {360.0, 1440.0}) {
    for (double mps = 0.02; mps < 0.601; mps += 0.0193) {
      for (const double direction : {1.0, -1.0}) {
        const double ticks_per_s = direction * mps * per_turn / (2 * 3.14159265 * 0.033);
        CHECK(std::abs(mean_error(ticks_per_s)) < 0.002);
      }
    }
  }
}

TEST(the_mean_is_right_next_to_three_ticks_in_four_steps) {
  CHECK(std::abs(mean_error(750.06)) < 0.001);
  CHECK(std::abs(mean_error(-750.06)) < 0.001);
}

TEST(the_mean_is_right_at_a_slow_control_rate) {
  const double ticks_per_m = 360.0 / (2 * 3.14159265 * 0.033);
  for (double mps = 0.02; mps < 0.601; mps += 0.58 / draws(290)) {
    CHECK(std::abs(mean_error(mps * ticks_per_m, 100)) < 0.003);
    CHECK(std::abs(mean_error(mps * ticks_per_m, 500)) < 0.002);
  }
}

TEST(a_wheel_that_moves_again_is_measured_anew) {
  VelocityEstimator estimator;
  turn(estimator, 700, 1.0);
  for (uint64_t t_us = 1'001'000; t_us <= 1'300'000; t_us += 1000)
    estimator.update(0, 0, t_us, kPeriod_us, kWindow_us);
  estimator.update(1, 0, 1'301'000, kPeriod_us, kWindow_us);
  estimator.update(1, 0, 1'306'000, kPeriod_us, kWindow_us);
  CHECK(estimator.ticks_per_s_q8() / 256 == 200);
}

TEST(a_setpoint_that_is_kept_on_a_ramp_shows_no_error) {
  VelocityEstimator estimator;
  double way = 0.0;
  int64_t counted = 0;
  for (int step = 1; step <= 400; ++step) {
    const double ticks_per_s = 5.0 * step;
    way += ticks_per_s / 1000.0;
    const auto position = static_cast<int64_t>(std::floor(way));
    const auto behind_q4 = static_cast<int32_t>((way - static_cast<double>(position)) * 576.0 * 16);
    estimator.update(static_cast<int32_t>(position - counted), static_cast<uint32_t>(behind_q4),
                     static_cast<uint64_t>(step) * 1000, kPeriod_us, kWindow_us);
    counted = position;
    // A tick in 20 ms is 29 mm/s; a window late on this ramp would be 37 mm/s.
    if (step > 100) CHECK(magnitude(estimator.falling_behind_umps()) < 25'000);
  }
}

TEST(velocity_falls_while_no_tick_comes) {
  VelocityEstimator estimator;
  turn(estimator, 700, 1.0);
  int32_t before = estimator.ticks_per_s_q8();
  for (uint64_t t_us = 1'001'000; t_us < 1'400'000; t_us += 1000) {
    estimator.update(0, 0, t_us, kPeriod_us, kWindow_us);
    // Before 1.5 periods have passed the estimate may still waver.
    if (t_us > 1'003'000) CHECK(estimator.ticks_per_s_q8() <= before);
    before = estimator.ticks_per_s_q8();
  }
  CHECK(before < 5 * 256);
  estimator.update(0, 0, 2'000'000, kPeriod_us, kWindow_us);
  CHECK(estimator.ticks_per_s_q8() == 0);
}

TEST(one_tick_to_and_fro_is_no_speed) {
  VelocityEstimator estimator;
  for (int i = 0; i < 100; ++i) {
    estimator.update(i % 2 == 0 ? 1 : -1, 0, static_cast<uint64_t>(i) * 1000, kPeriod_us,
                     kWindow_us);
    CHECK(estimator.ticks_per_s_q8() == 0);
  }
}

TEST(two_readings_at_one_instant_are_survived) {
  VelocityEstimator estimator;
  estimator.update(1, 0, 1000, kPeriod_us, kWindow_us);
  estimator.update(1, 0, 1000, kPeriod_us, kWindow_us);
  estimator.update(0, 0, 1000, kPeriod_us, kWindow_us);
  CHECK(estimator.ticks_per_s_q8() == 0);
}
