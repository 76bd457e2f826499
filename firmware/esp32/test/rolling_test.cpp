#include "rolling.hpp"

#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr int32_t kThreshold = 250'000;

/// After how many ms of the speeds that `speed(ms)` gives the robot is reported as rolling; -1: it
/// is not.
int reported_after(RollingMonitor& monitor, int duration_ms, auto speed,
                   uint32_t measured_us = 20'000) {
  for (int ms = 0; ms < duration_ms; ++ms)
    if (monitor.update(speed(ms), static_cast<uint64_t>(ms) * 1000, kThreshold, measured_us))
      return ms;
  return -1;
}

}  // namespace

TEST(rolling_is_reported_within_a_second_and_once) {
  RollingMonitor monitor;
  const auto accelerating = [](int ms) { return 250 * ms; };  // Exceeds the threshold after 1 s.
  const int after_ms = reported_after(monitor, 3000, accelerating);
  CHECK(after_ms > 1000 && after_ms < 2000);
  CHECK(reported_after(monitor, 3000, [](int) { return 900'000; }) == -1);
  monitor.reset();
  CHECK(reported_after(monitor, 3000, [](int) { return 900'000; }) > 0);
}

TEST(a_robot_that_slows_down_is_not_reported) {
  RollingMonitor braked;
  CHECK(reported_after(braked, 3000, [](int ms) { return 4'000'000 / (1 + ms / 50); }) == -1);
  RollingMonitor coasting;
  CHECK(reported_after(coasting, 3000, [](int ms) { return 1'000'000 - 500 * ms; }) == -1);
}

TEST(a_braked_robot_is_not_reported_however_long_its_speed_is_measured) {
  // It accelerated when it was stopped: what is measured rises for as long as it still shows that.
  const auto measured = [](int ms) {
    return ms < 200 ? 300'000 + 3'500 * ms : 1'000'000 >> ((ms - 200) / 100);
  };
  RollingMonitor monitor;
  CHECK(reported_after(monitor, 3000, measured, 200'000) == -1);
}

TEST(a_gentle_push_is_not_reported) {
  RollingMonitor monitor;
  CHECK(reported_after(monitor, 60'000, [](int) { return kThreshold - 1; }) == -1);
}

TEST(a_robot_that_rolls_is_reported_to_the_next_host_as_well) {
  RobotBench bench;
  bench.start();
  bench.roll(1000);
  bench.send(RobotBench::hello(RobotBench::kNonce));
  bench.roll(2000);
  CHECK(bench.count(EventCode::kRolling) == 1);
}
