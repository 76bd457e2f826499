// What a power stage gets in the time around a change of duty, with a PWM faster and slower than
// the control steps.
#include "stage_pins.hpp"

#include <algorithm>
#include <vector>

#include "check.hpp"
#include "stage_boards.hpp"
#include "wired_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr int64_t kStepUs = 1000;
constexpr uint32_t kFrequencies[] = {100, 333, 999, 1000, 1001, 20'000};

constexpr int16_t duty(double fraction) { return static_cast<int16_t>(fraction * INT16_MAX); }

/// What the left stage's inputs ask of it at one time.
enum class Asks { kNothing, kForward, kReverse, kBrake };

struct StageBench {
  StageBench(Stage stage, uint32_t frequency_hz) : board(board_of(stage)), table(*table_of(stage)) {
    fake_matrix = {};
    fake_time_us += 1'000'000;
    Parameters parameters;
    CHECK(parameters.set(ParameterId::kPwmFrequencyHz, static_cast<float>(frequency_hz)) ==
          RefusalCode::kNone);
    CHECK(robot.start(parameters));
    period_us = 1'000'000 / frequency_hz;
    sample_ns = std::min<int64_t>(50 * period_us, 50'000);
  }

  Asks asks(int64_t t_ns) {
    const auto shows = [&](StageAction action) {
      const StageLevel* const row = table.rows[static_cast<size_t>(action)];
      for (size_t i = 0; i < kStageInputs; ++i) {
        if (row[i] == StageLevel::kKeep) continue;
        const bool level = fake_matrix.level_at(board.pin(input_of(0, i)), t_ns);
        if (level != (row[i] != StageLevel::kLow)) return false;
      }
      return true;
    };
    if (shows(StageAction::kForward)) return Asks::kForward;
    if (shows(StageAction::kReverse)) return Asks::kReverse;
    if (shows(StageAction::kBrake)) return Asks::kBrake;
    return Asks::kNothing;
  }

  /// Control steps that call `act`. What they ask of the stage is then in `seen`.
  void steps(int count, auto act) {
    seen.clear();
    for (int i = 0; i < count; ++i) {
      act(robot.left_motor);
      for (int64_t ns = 0; ns < 1000 * kStepUs; ns += sample_ns)
        seen.push_back(asks(1000 * fake_time_us + ns));
      fake_time_us += kStepUs;
    }
  }
  void drive(int count, double fraction) {
    steps(count, [&](MotorPort& motor) { motor.drive(duty(fraction)); });
  }

  size_t count(Asks what) const {
    return static_cast<size_t>(std::count(seen.begin(), seen.end(), what));
  }
  /// The largest part of any span of one PWM period in which the stage was asked for `what`.
  double most_of_a_period(Asks what) const {
    const auto window = static_cast<size_t>(1000 * period_us / sample_ns);
    size_t in_window = 0;
    size_t most = 0;
    for (size_t i = 0; i < seen.size(); ++i) {
      in_window += seen[i] == what;
      if (i >= window) in_window -= seen[i - window] == what;
      most = std::max(most, in_window);
    }
    return static_cast<double>(most) / static_cast<double>(window);
  }

  BoardDescription board;
  const StageTable& table;
  WiredRobot robot{board};
  int64_t period_us = 0;
  int64_t sample_ns = 0;  ///< At least twenty in each period.
  std::vector<Asks> seen;
};

/// And at every frequency.
void at_every_stage(auto test) {
  on_every_stage([&](const BoardDescription& board) {
    for (const uint32_t frequency_hz : kFrequencies) test(board.stage, frequency_hz);
  });
}

/// Two periods of the slowest PWM.
constexpr int kLong = 25;

}  // namespace

TEST(a_reversal_shows_the_new_direction_with_the_new_duty_only) {
  at_every_stage([](Stage stage, uint32_t frequency_hz) {
    // The first reversal finds a comparator that never had a duty, on a stage with one for each
    // direction; the short ones are too soon for a slow PWM.
    StageBench bench(stage, frequency_hz);
    bench.drive(kLong, 0.9);
    for (const int steps : {kLong, kLong, 3, 3, kLong}) {
      for (const double fraction : {-0.1, 0.6}) {
        bench.drive(steps, fraction);
        const Asks wanted = fraction > 0 ? Asks::kForward : Asks::kReverse;
        const Asks other = fraction > 0 ? Asks::kReverse : Asks::kForward;
        CHECK(bench.count(other) == 0);
        CHECK(bench.most_of_a_period(wanted) <= std::abs(fraction) + 0.055);
        CHECK(steps < kLong || bench.count(wanted) > 0);
      }
    }
  });
}

TEST(a_drive_after_a_brake_or_a_full_drive_shows_its_own_duty_only) {
  at_every_stage([](Stage stage, uint32_t frequency_hz) {
    for (const bool brakes : {false, true}) {
      StageBench bench(stage, frequency_hz);
      if (brakes) bench.steps(kLong, [](MotorPort& motor) { motor.brake(); });
      if (!brakes) bench.drive(kLong, 1.0);
      bench.drive(2 * kLong, -0.2);
      CHECK(bench.count(Asks::kForward) == 0);
      CHECK(bench.most_of_a_period(Asks::kReverse) <= 0.255);
      CHECK(bench.count(Asks::kReverse) > 0);
    }
  });
}

TEST(a_coast_acts_at_once) {
  at_every_stage([](Stage stage, uint32_t frequency_hz) {
    for (const double fraction : {0.5, 1.0, -1.0}) {
      StageBench bench(stage, frequency_hz);
      bench.drive(kLong, fraction);
      bench.steps(kLong, [](MotorPort& motor) { motor.coast(); });
      CHECK(bench.count(Asks::kForward) == 0 && bench.count(Asks::kReverse) == 0);
    }
  });
}

TEST(a_brake_follows_a_control_period_of_coast_and_lasts) {
  at_every_stage([](Stage stage, uint32_t frequency_hz) {
    StageBench bench(stage, frequency_hz);
    bench.drive(kLong, 0.5);
    bench.drive(3, -0.5);
    bench.steps(1, [](MotorPort& motor) { motor.brake(); });
    bench.steps(kLong, [](MotorPort& motor) { motor.brake(); });
    CHECK(bench.count(Asks::kBrake) == bench.seen.size());
  });
}

TEST(the_smallest_duties_are_a_tick_and_no_level) {
  for (const uint32_t frequency_hz : {20'000u, 40'000u}) {
    for (int16_t duty_q15 = 1; duty_q15 <= 20; ++duty_q15) {
      StageBench bench(Stage::kEnableIn1In2, frequency_hz);
      for (int i = 0; i < 2; ++i) bench.robot.left_motor.drive(duty_q15);
      fake_time_us += kStepUs;
      const int enable = bench.board.left_enable;
      int64_t high_ns = 0;
      for (int64_t ns = 0; ns < 1000 * bench.period_us; ++ns)
        high_ns += fake_matrix.level_at(enable, 1000 * fake_time_us + ns);
      CHECK(high_ns >= 12 && high_ns < 40);
    }
  }
}
