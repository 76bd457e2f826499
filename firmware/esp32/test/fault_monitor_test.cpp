#include "fault_monitor.hpp"

#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

namespace {

/// The defaults.
constexpr FaultThresholds kThresholds{.stall_duty_q15 = 14'745,
                                      .stall_time_us = 500'000,
                                      .reversal_duty_q15 = 9830,
                                      .reversal_umps = 150'000};
constexpr int32_t kLow_q15 = 4915;  // 0.15, below both thresholds

/// A wheel at 1000 control steps a second.
struct Bench {
  FaultMonitor monitor;
  int32_t ticks = 0;

  WheelFault step(const WheelOutput& output, int32_t umps) {
    return monitor.update(output, ticks, umps, 1000, kThresholds);
  }
  /// Calls `each` with the step's number until a fault trips, and returns when; -1: it is another
  /// one, 0: none within 3 s.
  int steps_to(WheelFault fault, auto each) {
    for (int i = 1; i <= 3000; ++i) {
      const WheelFault found = each(i);
      if (found != WheelFault::kNone) return found == fault ? i : -1;
    }
    return 0;
  }
  int steps_to(WheelFault fault, const WheelOutput& output, int32_t umps = 0) {
    return steps_to(fault, [&](int i) {
      if (umps != 0) ticks += i % 2 * sign(umps);
      return step(output, umps);
    });
  }
};

constexpr WheelOutput open_loop(int32_t duty_q15) {
  return {.duty_q15 = duty_q15, .limit_q15 = WheelOutput::kNoLimit, .direction = 0};
}

constexpr WheelOutput at_limit(int32_t limit_q15, int32_t direction = 1) {
  return {.duty_q15 = limit_q15 * direction, .limit_q15 = limit_q15, .direction = direction};
}

/// Turns the left wheel steadily for some steps, at a setpoint of the left wheel's.
void turn_for(RobotBench& bench, int steps, int ticks_per_8_steps, float setpoint) {
  for (int i = 0; i < steps; ++i) {
    if (i % 100 == 0) bench.send(bench.velocity(setpoint, 0));
    if (i % 8 == 0) bench.turn(ticks_per_8_steps, 0);
    bench.step();
  }
}

}  // namespace

TEST(a_wheel_that_stands_at_its_limit_trips_however_low_that_is) {
  for (const int32_t direction : {1, -1}) {
    CHECK(Bench().steps_to(WheelFault::kNotCounting, at_limit(32'767, direction)) == 500);
    CHECK(Bench().steps_to(WheelFault::kNotCounting, open_loop(20'000 * direction)) == 500);
    const int low = Bench().steps_to(WheelFault::kNotCounting, at_limit(kLow_q15, direction));
    CHECK(low > 800 && low < 900);
  }
}

TEST(an_encoder_that_trembles_on_an_edge_does_not_hide_a_wheel_that_stands) {
  Bench bench;
  CHECK(bench.steps_to(WheelFault::kNotCounting, [&](int i) {
    bench.ticks = i % 2;
    return bench.step(open_loop(20'000), 0);
  }) == 500);
}

TEST(below_its_limit_and_the_threshold_a_wheel_may_stand_and_without_a_loop_there_is_no_limit) {
  const WheelOutput gentle{.duty_q15 = 4000, .limit_q15 = kLow_q15, .direction = 1};
  CHECK(Bench().steps_to(WheelFault::kNotCounting, gentle) == 0);
  CHECK(Bench().steps_to(WheelFault::kNotCounting, open_loop(14'000)) == 0);
  CHECK(Bench().steps_to(WheelFault::kReversed, open_loop(14'000), -100'000) == 0);
}

TEST(a_setpoint_that_varies_does_not_hide_a_wheel_that_stands) {
  Bench bench;
  const int steps = bench.steps_to(WheelFault::kNotCounting, [&](int i) {
    WheelOutput output = at_limit(kLow_q15);
    if (i % 100 < 20) output.duty_q15 /= 2;
    return bench.step(output, 0);
  });
  CHECK(steps > 0 && steps <= 1500);
}

TEST(a_wheel_that_turns_as_it_is_driven_ends_what_was_seen_and_so_does_a_clear) {
  for (const bool is_cleared : {false, true}) {
    Bench bench;
    for (int i = 0; i < 400; ++i) bench.step(at_limit(32'767), 0);
    if (is_cleared)
      bench.monitor.end_evidence();
    else
      bench.ticks += 2;
    CHECK(bench.steps_to(WheelFault::kNotCounting, at_limit(32'767)) >= 499);
  }
  Bench bench;
  for (int i = 0; i < 400; ++i) bench.step(at_limit(32'767), -60'000);
  bench.step(at_limit(32'767), 60'000);
  CHECK(bench.steps_to(WheelFault::kReversed, at_limit(32'767), -60'000) == 500);
}

TEST(a_wheel_that_turns_back_steadily_at_its_limit_is_reversed) {
  for (const int32_t direction : {1, -1}) {
    const int steps =
        Bench().steps_to(WheelFault::kReversed, at_limit(kLow_q15, direction), -60'000 * direction);
    CHECK(steps == 500);
  }
}

TEST(in_open_loop_speed_that_grows_against_the_drive_is_reversed) {
  Bench bench;
  const int steps = bench.steps_to(WheelFault::kReversed, [&](int i) {
    ++bench.ticks;
    return bench.step(open_loop(-32'767), 1000 * i);
  });
  CHECK(steps > 0 && steps <= 152);
}

TEST(a_wheel_that_crawls_slows_down_or_brakes_is_sound) {
  const WheelOutput braking{.duty_q15 = -kLow_q15, .limit_q15 = kLow_q15, .direction = 1};
  const struct {
    WheelOutput output;
    int32_t umps, change;  ///< Its speed, and by how much it grows in each step.
    int tick_every;
    int steps;
  } wheels[] = {
      {at_limit(kLow_q15), 2000, 0, 250, 5000},
      {open_loop(20'000), 2000, 0, 250, 5000},
      {open_loop(-32'767), 400'000, -1000, 1, 400},
      // A heavy robot rolls back ever slower: from 0.4 m/s by 0.07 m/s^2.
      {at_limit(kLow_q15), -400'000, 70, 1, 5714},
      // Downhill for ever.
      {braking, 100'000, 100, 1, 5000},
  };
  for (const auto& wheel : wheels) {
    Bench bench;
    for (int i = 0; i < wheel.steps; ++i) {
      if (i % wheel.tick_every == 0) bench.ticks += sign(wheel.umps);
      CHECK(bench.step(wheel.output, wheel.umps + i * wheel.change) == WheelFault::kNone);
    }
  }
}

TEST(and_one_that_gains_speed_is_so_sooner) {
  Bench bench;
  CHECK(bench.steps_to(WheelFault::kReversed, [&](int i) {
    bench.ticks -= 1;
    return bench.step(at_limit(kLow_q15), -1000 * i);
  }) == 151);
}

// --- in a robot ----------------------------------------------------------------------------------

TEST(a_push_at_a_setpoint_of_zero_is_braked_and_no_fault) {
  OpenRobot bench;
  CHECK(bench.set(kMaxDuty, 0.2f) == RefusalCode::kNone);
  turn_for(bench, 2000, 3, 0);
  CHECK(bench.state() == SupervisorState::kDriving);
  CHECK(bench.left.brakes());
  // At rest the loop holds the wheel as before, and drives it when a setpoint asks for it.
  turn_for(bench, 1000, 0, 0);
  turn_for(bench, 200, 0, 0.1f);
  CHECK(bench.left.duty() > 0);
}

TEST(a_clear_ends_what_the_wheels_have_shown) {
  OpenRobot bench;
  const auto steps_to_fault = [&] {
    int steps = 0;
    while (steps < 3000 && bench.state() != SupervisorState::kFault) {
      if (steps % 100 == 0) bench.send(bench.velocity(0.3f, 0.3f));
      bench.step();
      ++steps;
    }
    return steps;
  };
  const int first = steps_to_fault();
  CHECK(first < 1000);
  bench.run(300);
  CHECK(bench.clear_fault() == RefusalCode::kNone);
  bench.drive(0, 0, 1);
  CHECK(steps_to_fault() >= first - 5);
}
