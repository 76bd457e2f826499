// What holds the robot, and what ended its last motion: each as the device reports it.
#include "sensor_bench.hpp"

namespace wheelwire::test {
namespace {

/// As asked between two steps.
Hold hold_of(RobotBench& bench) {
  const auto hold = bench.ask<Hold>(HoldGet{});
  CHECK(hold.has_value());
  return hold.value_or(Hold{});
}

/// Drives for long enough that its speed is measured.
void drive_on(RobotBench& bench) {
  for (int i = 0; i < 200; ++i) {
    bench.send(bench.velocity(0.2f, 0.2f));
    bench.roll(1);
  }
}

PeripheralList bumpers() {
  return list_of({bumper(Place::kFrontLeft, 36), bumper(Place::kRear, 39)});
}

}  // namespace

// --- what holds it -------------------------------------------------------------------------------

TEST(who_latched_an_estop_is_named_and_survives_a_reset) {
  OpenRobot by_another;
  by_another.estop();
  CHECK(hold_of(by_another).estop_source == EstopSource::kOtherProgram);
  OpenRobot first;
  first.contact.open = true;
  first.step();
  RobotBench second;
  second.survive_reset(first).open();
  CHECK(hold_of(second).estop_source == EstopSource::kContact);
  first.run(3000);
  RobotBench third;
  third.survive_power_cut(first).open();  // the power was off
  CHECK(hold_of(third).estop_source == EstopSource::kBeforePowerOn);
  RobotBench damaged;
  damaged.latches.record = first.latches.record;
  damaged.latches.record[5] ^= 1;
  damaged.open();
  CHECK(hold_of(damaged).estop_source == EstopSource::kDamagedRecord);
  CHECK(hold_of(damaged).stop_cause == StopCause::kUnknown);
}

TEST(a_fault_is_named_and_its_flags_are_in_the_stop) {
  OpenRobot bench;
  drive_on(bench);
  bench.step(100'000);
  const Hold hold = hold_of(bench);
  CHECK(hold.held == held::kFault);
  CHECK(hold.stop_cause == StopCause::kFault && hold.stop_faults == fault::kControlOverrun);
}

TEST(a_bumper_is_named_by_its_place_and_so_is_what_follows_it) {
  SensorBench bench(bumpers());
  bench.open();
  CHECK(hold_of(bench).held == 0);
  bench.drive_on(0.2f, 0.2f, 300);
  bench.set_level(0, true);
  bench.drive_on(0.2f, 0.2f, 10);
  Hold hold = hold_of(bench);
  CHECK(bench.state() == SupervisorState::kDriving);
  CHECK(hold.held == (held::kBumperFrontLeft | held::kUnarmedForward));
  CHECK(hold.stop_cause == StopCause::kBumper && hold.stop_held == held::kBumperFrontLeft);
  CHECK(hold.stop_mmps > 150 && hold.stop_command != 0);
  bench.set_level(0, false);
  bench.drive_on(0.2f, 0.2f, 100);
  CHECK(hold_of(bench).held == held::kUnarmedForward);
  // The end of a drive that the bumper has already stopped is not a new stop.
  bench.run(400);
  CHECK(bench.state() == SupervisorState::kTimedOut);
  hold = hold_of(bench);
  CHECK(hold.stop_cause == StopCause::kBumper && (hold.stop_flags & stopflag::kAtRest) != 0);
  bench.set_level(1, true);
  bench.run(1100);
  CHECK(hold_of(bench).held == held::kBumperRear);
}

// --- what ended the last motion ------------------------------------------------------------------

TEST(a_reset_while_it_moves_is_named_with_its_reason_once) {
  OpenRobot first;
  drive_on(first);
  RobotBench second;
  second.survive_reset(first).open();
  Hold hold = hold_of(second);
  CHECK(hold.stop_cause == StopCause::kReset && hold.stop_reset == ResetReason::kPowerOn);
  CHECK(hold.stop_session == first.session_id());
  CHECK((hold.stop_flags & stopflag::kEarlierStart) != 0 && hold.stop_us == 0);
  // What stood before another reset was not stopped by it.
  second.run(100);
  drive_on(second);
  second.send(second.stop());
  second.step();
  RobotBench third;
  third.survive_reset(second).open();
  hold = hold_of(third);
  CHECK(hold.stop_cause == StopCause::kStop && hold.stop_us == 0);
  CHECK((hold.stop_flags & stopflag::kEarlierStart) != 0 && hold.stop_mmps > 100);
}

TEST(a_drive_that_turned_no_wheel_ends_no_motion) {
  OpenRobot bench;
  drive_on(bench);
  bench.send(bench.stop());
  bench.step();
  bench.drive(0.0f, 0.0f);
  bench.run(400);
  CHECK(bench.state() == SupervisorState::kTimedOut);
  CHECK(hold_of(bench).stop_cause == StopCause::kStop);
}

// --- how it is reported --------------------------------------------------------------------------

TEST(each_change_is_reported_soon_what_lasts_each_second_and_chatter_does_not_fill_the_line) {
  SensorBench bench(bumpers());
  bench.open();
  bench.run(200);
  bench.received.clear();
  bench.run(2000);
  CHECK(bench.of<Hold>().size() == 2);
  bench.received.clear();
  bench.set_level(0, true);
  bench.run(120);
  CHECK(bench.of<Hold>().size() == 1);
  CHECK(bench.of<Hold>()[0].held == held::kBumperFrontLeft && bench.of<Hold>()[0].request_id == 0);
  bench.received.clear();
  for (int i = 0; i < 2000; ++i) {
    bench.set_level(0, i / 80 % 2 == 0);
    bench.step();
  }
  CHECK(bench.of<Hold>().size() >= 10 && bench.of<Hold>().size() <= 20);
}

TEST(a_repeat_of_the_question_is_answered_with_what_holds_it_now) {
  OpenRobot bench;
  CHECK(hold_of(bench).held == 0);
  bench.estop();
  bench.send(HoldGet{bench.session_id(), bench.request_id});
  bench.received.clear();
  bench.service();
  CHECK(bench.of<Hold>().size() == 1 && bench.of<Hold>()[0].held == held::kEstop);
}

}  // namespace wheelwire::test
