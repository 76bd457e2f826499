// Both wheels: what is forgotten at a stop, at a turn, and when a parameter changes.
#include "drive.hpp"

#include <initializer_list>
#include <utility>

#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

class DriveBench {
 public:
  void follow(int32_t umps, int right_ticks) { follow({umps, umps}, 0, right_ticks); }
  void follow(WheelPair umps, int left_ticks, int right_ticks) {
    latch(left_ticks, right_ticks);
    drive.follow(ControlMode::kVelocity, umps, config);
  }
  void stop() {
    drive.release();
    for (int step = 0; step < 300; ++step) {
      latch(0, 0);
      drive.keep_stopped(false);
    }
  }

  ControlConfig config = make_config(Parameters());
  BenchMotor left;
  BenchMotor right;
  Drive drive{left, right};
  EncoderCounts counts{};

 private:
  void latch(int left_ticks, int right_ticks) {
    counts.t_us += config.period_us;
    counts.left = static_cast<int16_t>(counts.left + left_ticks);
    counts.right = static_cast<int16_t>(counts.right + right_ticks);
    CHECK(drive.latch(counts, config) == 0);
  }
};

ControlConfig config_with(std::initializer_list<std::pair<ParameterId, float>> values) {
  Parameters parameters;
  for (const auto& [id, value] : values) CHECK(parameters.set(id, value) == RefusalCode::kNone);
  return make_config(parameters);
}

}  // namespace

TEST(what_a_wheel_was_behind_before_a_stop_is_not_made_up_after_it) {
  DriveBench bench;
  bench.drive.note_battery(7400, bench.config);
  // The left wheel is held fast.
  for (int step = 0; step < 150; ++step) bench.follow(200'000, step % 4 == 0);
  CHECK(bench.drive.left().behind_um() > 5000);
  bench.stop();
  bench.follow(200'000, 0);
  CHECK(magnitude(bench.drive.left().behind_um()) < 100);
}

TEST(a_supply_that_is_set_counts_from_the_next_step_on) {
  using enum ParameterId;
  // The battery always reads the same; or it reads nothing, and the set supply replaces it.
  for (const uint16_t battery_mv : std::initializer_list<uint16_t>{7400, 0}) {
    const auto at_nominal = [](float nominal_v) {
      return config_with({{kNominalSupplyV, nominal_v},
                          {kUnmeasuredSupplyV, 7.4f},
                          {kSupplyDropV, 0},
                          {kProportionalGain, 10}});
    };
    DriveBench bench;
    bench.config = at_nominal(7.4f);
    bench.drive.note_battery(battery_mv, bench.config);
    // Both wheels are held fast, and driven at their limit.
    for (int step = 0; step < 200; ++step) bench.follow(100'000, 0);
    const int32_t before_q15 = bench.left.duty;
    CHECK(bench.drive.left().saturated() && before_q15 > 8000);
    bench.config = at_nominal(3.7f);
    bench.drive.note_parameters(bench.config);
    bench.follow(100'000, 0);
    CHECK(magnitude(bench.left.duty - before_q15 / 2) < 100);
    CHECK(bench.left.duty == bench.right.duty);
  }
}

TEST(a_wheel_that_was_blocked_is_not_driven_the_old_way_once_it_is_to_turn_back) {
  using enum ParameterId;
  struct Case {
    float integral_gain, proportional_gain, path_gain;
  };
  // The integral contains how far the wheel was behind, and so does the rate at which it falls
  // behind.
  for (const Case& c : {Case{8, 0, 0}, Case{8, 0, 4}, Case{0, 1, 4}}) {
    DriveBench bench;
    bench.config = config_with({{kIntegralGain, c.integral_gain},
                                {kProportionalGain, c.proportional_gain},
                                {kPathGain, c.path_gain},
                                {kVelocityFeedforward, 0},
                                {kAccelerationFeedforward, 0}});
    bench.drive.note_battery(7400, bench.config);
    for (int step = 0; step < 300; ++step) bench.follow(200'000, 0);
    const int blocked_q15 = bench.left.duty;
    CHECK(blocked_q15 > 1000);
    // By slewing: from one sign to the other without a step at zero.
    int steps = 0;
    while (bench.drive.commanded().left >= 0 && ++steps < 1000) bench.follow(-200'000, 0);
    CHECK(steps < 1000 && bench.drive.commanded().left < 0);
    for (int step = 0; step < 50; ++step) {
      CHECK(bench.left.duty < blocked_q15 / 20 && bench.right.duty < blocked_q15 / 20);
      bench.follow(-200'000, 0);
    }
  }
}

TEST(a_wheel_that_no_longer_has_to_wait_speeds_up_within_the_limit) {
  constexpr int32_t kSpeed_umps = 200'000;
  for (const bool left_is_held : {true, false}) {
    DriveBench bench;
    bench.drive.note_battery(7400, bench.config);
    double travelled_um = 0;
    int counted = 0;
    // The other wheel follows its command.
    const auto step = [&](WheelPair umps) {
      const WheelPair before = bench.drive.commanded();
      const int32_t waits = left_is_held ? before.right : before.left;
      travelled_um += waits * 1e-6 * bench.config.period_us;
      const int ticks = static_cast<int>(travelled_um * 1024 / bench.config.um_per_tick_q10);
      const int moved = ticks - counted;
      counted = ticks;
      bench.follow(umps, left_is_held ? 0 : moved, left_is_held ? moved : 0);
      const WheelPair after = bench.drive.commanded();
      CHECK(magnitude(after.left - before.left) <= bench.config.velocity_slew_umps);
      CHECK(magnitude(after.right - before.right) <= bench.config.velocity_slew_umps);
      return left_is_held ? after.right : after.left;
    };
    int32_t slowest_umps = kSpeed_umps;
    for (int i = 0; i < 350; ++i) {
      const int32_t umps = step({kSpeed_umps, kSpeed_umps});
      if (i > 200 && umps < slowest_umps) slowest_umps = umps;
    }
    CHECK(slowest_umps < kSpeed_umps / 2);  // It waits.
    const WheelPair turn = left_is_held ? WheelPair{0, kSpeed_umps} : WheelPair{kSpeed_umps, 0};
    int32_t fastest_umps = 0;
    for (int i = 0; i < 300; ++i) {
      const int32_t umps = step(turn);
      if (umps > fastest_umps) fastest_umps = umps;
    }
    CHECK(fastest_umps > kSpeed_umps * 9 / 10);
  }
}
