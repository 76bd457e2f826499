#include "stop_action.hpp"

#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;
using enum StopMode;

namespace {

constexpr uint32_t kBrakeUs = 1'000'000;

/// Whether the short stays closed from here on, for this many steps.
bool stays_shorted(RobotBench& bench, int steps) {
  for (int i = 0; i < steps; ++i) {
    bench.step();
    if (!bench.left.brakes() || !bench.right.brakes()) return false;
  }
  return true;
}

}  // namespace

TEST(a_weaker_stop_replaces_only_where_it_may) {
  for (const StopMode first : {kCoast, kBrake, kBrakeUntilDriven}) {
    for (const StopMode second : {kCoast, kBrake, kBrakeUntilDriven}) {
      for (const bool may_weaken : {false, true}) {
        StopAction action;
        action.begin(first, false, 0, kBrakeUs);
        action.begin(second, may_weaken, 0, kBrakeUs);
        const StopMode expected = second > first || may_weaken ? second : first;
        CHECK(action.brakes(kBrakeUs - 1, true, false) == (expected != kCoast));
        CHECK(action.brakes(kBrakeUs, true, false) == (expected == kBrakeUntilDriven));
      }
    }
  }
}

TEST(an_equal_stop_brakes_for_longer_and_never_for_less) {
  StopAction action;
  action.begin(kBrake, false, 0, kBrakeUs);
  action.begin(kBrake, false, 100, kBrakeUs / 2);
  CHECK(action.brakes(kBrakeUs - 1, true, false));
  action.begin(kBrake, false, kBrakeUs - 1, kBrakeUs);
  CHECK(action.brakes(2 * kBrakeUs - 2, true, false));
  CHECK(!action.brakes(2 * kBrakeUs - 1, true, false));
}

TEST(an_estop_brakes_until_the_wheels_are_still_and_again_while_it_is_latched) {
  StopAction action;
  action.begin_estop(kBrake, 0, kBrakeUs);
  CHECK(action.brakes(10 * kBrakeUs, false, true));
  CHECK(!action.brakes(11 * kBrakeUs, true, true));
  CHECK(action.brakes(12 * kBrakeUs, false, true));
  // Once it is cleared it ends the next time that they are still.
  CHECK(action.brakes(13 * kBrakeUs, false, false));
  CHECK(!action.brakes(14 * kBrakeUs, true, false));
  CHECK(!action.brakes(15 * kBrakeUs, false, false));
}

TEST(a_brake_until_driven_outlasts_an_estop) {
  StopAction action;
  action.begin(kBrakeUntilDriven, false, 0, kBrakeUs);
  action.begin_estop(kBrake, 0, kBrakeUs);
  for (const bool is_latched : {true, false}) CHECK(action.brakes(20 * kBrakeUs, true, is_latched));
}

TEST(a_stop_that_follows_an_estop_leaves_it_as_it_is) {
  StopAction action;
  action.begin_estop(kBrake, 0, kBrakeUs);
  action.begin(kBrake, false, kBrakeUs, kBrakeUs);
  CHECK(action.brakes(3 * kBrakeUs, false, true));
}

// --- at the robot's pins -------------------------------------------------------------------------

TEST(neither_a_stop_at_a_setpoint_of_zero_nor_a_flood_of_them_opens_the_short) {
  OpenRobot bench;
  bench.drive(0.0f, 0.0f);
  CHECK(bench.brakes());
  bench.send(bench.stop(kBrake));
  CHECK(stays_shorted(bench, 500));
  for (int i = 0; i < 500; ++i) {
    Stop stop = bench.stop(i % 3 == 0 ? kBrake : kConfigured);
    if (i % 2 == 0) stop.session_id ^= 1;
    bench.send(stop);
    if (i % 5 == 0) bench.send(Estop{});
    CHECK(stays_shorted(bench, 1));
  }
}

TEST(an_estop_brakes_although_stops_coast_unless_its_own_mode_is_to_coast) {
  for (const auto mode : {ParameterId::kStopMode, ParameterId::kEstopMode}) {
    OpenRobot bench;
    CHECK(bench.set(mode, static_cast<float>(kCoast)) == RefusalCode::kNone);
    bench.drive(0.2f, 0.2f);
    bench.send(Estop{});
    for (int i = 0; i < 100; ++i) {
      bench.step();
      if (mode == ParameterId::kEstopMode) CHECK(!bench.left.brakes() && !bench.right.brakes());
    }
    CHECK(bench.brakes() == (mode == ParameterId::kStopMode));
  }
}

TEST(a_power_stage_that_reports_a_fault_is_switched_off_and_any_other_input_brakes) {
  for (const uint8_t tripped : {uint8_t{0}, kStageTripped}) {
    OpenRobot bench;
    CHECK(bench.set(ParameterId::kStopMode, static_cast<float>(kBrake)) == RefusalCode::kNone);
    bench.drive(0.2f, 0.2f);
    bench.device.note_reflexes(static_cast<uint8_t>(reflex::kStop | tripped));
    bench.run(5);
    CHECK(bench.state() == SupervisorState::kFault);
    CHECK(bench.left.brakes() == (tripped == 0) && bench.right.brakes() == (tripped == 0));
  }
}
