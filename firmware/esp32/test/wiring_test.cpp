// motors_swapped and encoders_swapped, wherever a wheel meets a pin.
#include "check.hpp"
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using test::OpenRobot;
using test::RobotBench;

namespace {

WheelState newest_state(RobotBench& bench) {
  bench.received.clear();
  bench.run(20);
  return bench.of<WheelState>().back();
}

void swap(RobotBench& bench, ParameterId id, float value = 1) {
  CHECK(bench.set(id, value) == RefusalCode::kNone);
}

MemoryStore saved_with_both_swaps() {
  OpenRobot bench;
  swap(bench, kMotorsSwapped);
  swap(bench, kEncodersSwapped);
  CHECK(bench.refusal(ParameterSave{}) == RefusalCode::kNone);
  return bench.store;
}

}  // namespace

TEST(swapped_motors_are_driven_by_the_other_bridge) {
  OpenRobot bench;
  swap(bench, kMotorsSwapped);
  bench.send(bench.duty(8'000, -3'000));
  bench.run(100);
  CHECK(bench.right.duty() == 8'000 && bench.left.duty() == -3'000);
  const WheelState state = newest_state(bench);
  CHECK(state.left_duty_q15 == 8'000 && state.right_duty_q15 == -3'000);
  bench.send(bench.stop());
  bench.step();
  CHECK(bench.left.enable == 0 && bench.right.enable == 0);
  bench.run(3);
  CHECK(bench.left.brakes() && bench.right.brakes());
}

TEST(swapped_motors_keep_their_directions) {
  OpenRobot bench;
  swap(bench, kLeftMotorInverted);
  swap(bench, kMotorsSwapped);
  bench.send(bench.duty(8'000, 3'000));
  bench.run(100);
  CHECK(bench.right.duty() == -8'000 && bench.left.duty() == 3'000);
}

TEST(motors_are_swapped_back) {
  OpenRobot bench;
  swap(bench, kMotorsSwapped);
  swap(bench, kMotorsSwapped, 0);
  bench.send(bench.duty(8'000, 0));
  bench.run(100);
  CHECK(bench.left.duty() == 8'000 && bench.right.duty() == 0);
}

TEST(a_reset_of_the_parameters_swaps_back) {
  OpenRobot bench;
  swap(bench, kMotorsSwapped);
  swap(bench, kEncodersSwapped);
  CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kNone);
  bench.send(bench.duty(8'000, 0));
  bench.run(50);
  bench.turn(10, 0);
  CHECK(bench.left.duty() == 8'000 && bench.right.duty() == 0);
  CHECK(newest_state(bench).left_ticks == 10);
}

TEST(swapped_encoders_count_the_other_wheel) {
  OpenRobot bench;
  bench.turn(100, 7);
  bench.step();
  swap(bench, kEncodersSwapped);
  bench.turn(3, -20);
  bench.step();
  const WheelState state = newest_state(bench);
  CHECK(state.left_ticks == 80 && state.right_ticks == 10);
}

TEST(ticks_at_the_moment_of_a_swap_are_counted_once) {
  OpenRobot bench;
  bench.turn(20'000 - 32'767, 5);
  bench.step();
  bench.turn(11, 0);  // after the last latch, before the swap
  swap(bench, kEncodersSwapped);
  bench.step();
  const WheelState state = newest_state(bench);
  CHECK(state.left_ticks == 20'000 - 32'767 && state.right_ticks == 16);
}

TEST(swapped_encoders_keep_their_directions) {
  OpenRobot bench;
  swap(bench, kLeftEncoderInverted);
  swap(bench, kEncodersSwapped);
  bench.turn(30, 40);
  bench.step();
  const WheelState state = newest_state(bench);
  CHECK(state.left_ticks == -40 && state.right_ticks == 30);
}

TEST(illegal_transitions_are_those_of_the_wheels_encoder) {
  OpenRobot bench;
  bench.encoders.counts.left_illegal = 3;
  bench.encoders.counts.right_illegal = 5;
  swap(bench, kEncodersSwapped);
  bench.step();
  const auto counters = bench.ask<ControlCounters>(ControlCountersGet{});
  CHECK(counters && counters->left_illegal == 5 && counters->right_illegal == 3);
}

TEST(saved_swaps_hold_from_the_start) {
  RobotBench bench;
  bench.store = saved_with_both_swaps();
  bench.encoders.counts.left = 50;  // the register before the start does not count as travel
  bench.open();
  bench.turn(2, 9);
  bench.send(bench.duty(0, 6'000));
  bench.run(100);
  CHECK(bench.left.duty() == 6'000 && bench.right.duty() == 0);
  const WheelState state = newest_state(bench);
  CHECK(state.left_ticks == 9 && state.right_ticks == 2);
}

TEST(nothing_is_swapped_while_driving) {
  for (const ParameterId id : {kMotorsSwapped, kEncodersSwapped}) {
    RobotBench bench;
    bench.open().drive(0.2f, 0.1f);
    CHECK(bench.set(id, 1) == RefusalCode::kNotStopped);
    bench.step();
    CHECK(bench.left.duty() > bench.right.duty());
  }
}
