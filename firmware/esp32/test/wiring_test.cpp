// motors_swapped and encoders_swapped, wherever a wheel meets a pin.
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

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

TEST(swapped_encoders_count_on_from_what_they_had_counted_and_their_transitions_are_the_wheels) {
  OpenRobot bench;
  bench.encoders.counts.left_illegal = 3;
  bench.encoders.counts.right_illegal = 5;
  bench.roll(1, 100, 7);
  bench.configure({{kEncodersSwapped, 1}});
  bench.roll(1, 3, -20);
  const WheelState state = bench.newest_state();
  CHECK(state.left_ticks == 80 && state.right_ticks == 10);
  const auto counters = bench.ask<ControlCounters>(ControlCountersGet{});
  CHECK(counters && counters->left_illegal == 5 && counters->right_illegal == 3);
}
