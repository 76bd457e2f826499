// motors_swapped and encoders_swapped, wherever a wheel meets a pin.
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

namespace {

constexpr std::initializer_list<std::pair<ParameterId, float>> kBothSwapped = {
    {kMotorsSwapped, 1}, {kEncodersSwapped, 1}};

}  // namespace

TEST(each_motor_and_each_encoder_has_its_inversion_and_pairs_are_swapped) {
  const struct {
    std::initializer_list<std::pair<ParameterId, float>> parameters;
    int left_duty, right_duty;    ///< At the bridges, of a setpoint of 8000 and 3000.
    int left_ticks, right_ticks;  ///< Of counters that count 10 and 25.
  } cases[] = {
      {{}, 8'000, 3'000, 10, 25},
      {{{kLeftMotorInverted, 1}}, -8'000, 3'000, 10, 25},
      {{{kRightMotorInverted, 1}}, 8'000, -3'000, 10, 25},
      {{{kLeftEncoderInverted, 1}}, 8'000, 3'000, -10, 25},
      {{{kRightEncoderInverted, 1}}, 8'000, 3'000, 10, -25},
      {{{kMotorsSwapped, 1}}, 3'000, 8'000, 10, 25},
      {{{kMotorsSwapped, 1}, {kMotorsSwapped, 0}}, 8'000, 3'000, 10, 25},
      {{{kEncodersSwapped, 1}}, 8'000, 3'000, 25, 10},
      // The wheels keep their directions.
      {{{kLeftMotorInverted, 1}, {kMotorsSwapped, 1}}, 3'000, -8'000, 10, 25},
      {{{kLeftEncoderInverted, 1}, {kEncodersSwapped, 1}}, 8'000, 3'000, -25, 10},
  };
  for (const auto& one : cases) {
    OpenRobot bench;
    bench.configure(one.parameters);
    bench.drive_duty(8'000, 3'000);
    CHECK(bench.left.duty() == one.left_duty && bench.right.duty() == one.right_duty);
    bench.turn(10, 25);
    const WheelState state = bench.newest_state();
    CHECK(state.left_duty_q15 == 8'000 && state.right_duty_q15 == 3'000);
    CHECK(state.left_ticks == one.left_ticks && state.right_ticks == one.right_ticks);
    bench.send(bench.stop());
    bench.step();
    CHECK(bench.coasts());
    bench.run(3);
    CHECK(bench.brakes());
  }
}

TEST(a_reset_of_the_parameters_swaps_back) {
  OpenRobot bench;
  bench.configure(kBothSwapped);
  CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kNone);
  bench.drive_duty(8'000, 0, 50);
  bench.turn(10, 0);
  CHECK(bench.left.duty() == 8'000 && bench.right.duty() == 0);
  CHECK(bench.newest_state().left_ticks == 10);
}

TEST(swapped_encoders_count_on_from_what_they_had_counted) {
  OpenRobot bench;
  bench.roll(1, 100, 7);
  bench.configure({{kEncodersSwapped, 1}});
  bench.roll(1, 3, -20);
  const WheelState state = bench.newest_state();
  CHECK(state.left_ticks == 80 && state.right_ticks == 10);
}

TEST(ticks_at_the_moment_of_a_swap_are_counted_once) {
  OpenRobot bench;
  bench.turn(20'000 - 32'767, 5);
  bench.step();
  bench.turn(11, 0);  // after the last latch, before the swap
  bench.configure({{kEncodersSwapped, 1}});
  bench.step();
  const WheelState state = bench.newest_state();
  CHECK(state.left_ticks == 20'000 - 32'767 && state.right_ticks == 16);
}

TEST(illegal_transitions_are_those_of_the_wheels_encoder) {
  OpenRobot bench;
  bench.encoders.counts.left_illegal = 3;
  bench.encoders.counts.right_illegal = 5;
  bench.configure({{kEncodersSwapped, 1}});
  bench.step();
  const auto counters = bench.ask<ControlCounters>(ControlCountersGet{});
  CHECK(counters && counters->left_illegal == 5 && counters->right_illegal == 3);
}

TEST(saved_swaps_hold_from_the_start) {
  OpenRobot saved;
  saved.configure(kBothSwapped);
  CHECK(saved.refusal(ParameterSave{}) == RefusalCode::kNone);
  RobotBench bench;
  bench.store = saved.store;
  bench.encoders.counts.left = 50;  // the register before the start does not count as travel
  bench.open();
  bench.turn(2, 9);
  bench.drive_duty(0, 6'000);
  CHECK(bench.left.duty() == 6'000 && bench.right.duty() == 0);
  const WheelState state = bench.newest_state();
  CHECK(state.left_ticks == 9 && state.right_ticks == 2);
}
