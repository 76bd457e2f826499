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

/// What is said of the end of a drive, which `end` ends.
Hold stopped_by(auto end) {
  OpenRobot bench;
  drive_on(bench);
  end(bench);
  bench.step();
  return hold_of(bench);
}

PeripheralList bumpers() {
  return list_of({bumper(Place::kFrontLeft, 36), bumper(Place::kRear, 39)});
}

}  // namespace

// --- what holds it -------------------------------------------------------------------------------

TEST(nothing_holds_a_robot_that_is_armed) {
  OpenRobot bench;
  const Hold hold = hold_of(bench);
  CHECK(hold.held == 0 && hold.estop_source == EstopSource::kNone && hold.contradictions == 0);
  CHECK(hold.stop_cause == StopCause::kUnknown);
  CHECK(hold.session_id == bench.session_id());
}

TEST(a_start_holds_until_a_zero_setpoint_or_a_pause) {
  RobotBench bench;
  bench.connect();
  CHECK(hold_of(bench).held == 0);  // no program tries to drive
  bench.drive(0.2f, 0.2f);
  CHECK(hold_of(bench).held == held::kUnarmed);
  bench.run(1100);
  CHECK(hold_of(bench).held == 0);  // a setpoint would drive
  RobotBench armed;
  armed.connect();
  armed.arm();
  CHECK(hold_of(armed).held == 0);
}

TEST(an_estop_is_named_with_who_latched_it) {
  OpenRobot bench;
  bench.estop();
  Hold hold = hold_of(bench);
  CHECK(hold.held == held::kEstop && hold.estop_source == EstopSource::kOtherProgram);
  CHECK(bench.clear_estop() == RefusalCode::kNone);
  hold = hold_of(bench);
  CHECK(hold.held == 0 && hold.estop_source == EstopSource::kNone);
  bench.drive(0.2f, 0.2f);
  CHECK(hold_of(bench).held == held::kUnarmed);
  bench.send(Estop{.session_id = bench.session_id()});
  bench.step();
  CHECK(hold_of(bench).estop_source == EstopSource::kSession);
  bench.contact.open = true;
  bench.step();
  hold = hold_of(bench);
  CHECK(hold.held == (held::kEstop | held::kContact));
  CHECK(hold.estop_source == EstopSource::kSession);  // who was first
}

TEST(an_open_contact_is_named) {
  RobotBench bench;
  bench.contact.open = true;
  bench.open();
  const Hold hold = hold_of(bench);
  CHECK(hold.held == (held::kEstop | held::kContact));
  CHECK(hold.estop_source == EstopSource::kContact);
}

TEST(who_latched_an_estop_survives_a_reset) {
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
  const Hold hold = stopped_by([](RobotBench& bench) { bench.now_us += 100'000; });
  CHECK(hold.held == held::kFault);
  CHECK(hold.stop_cause == StopCause::kFault && hold.stop_faults == fault::kControlOverrun);
}

TEST(contradictions_are_named_by_parameter) {
  OpenRobot bench;
  bench.ask<Ack>(ParameterTrial{.action = TrialAction::kBegin, .timeout_s = 0.3f});
  CHECK(bench.set(ParameterId::kStreamRateHz, 2000) == RefusalCode::kNone);
  Hold hold = hold_of(bench);
  CHECK(hold.held == held::kContradiction);
  CHECK(hold.contradictions == contradiction::kStreamRate);
  bench.run(301);
  hold = hold_of(bench);
  CHECK(hold.held == held::kTrialOver && hold.contradictions == 0);
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

TEST(inputs_that_stop_are_named_by_their_kind) {
  const struct {
    PeripheralKind kind;
    uint32_t flag;
    StopCause cause;
  } kinds[] = {{PeripheralKind::kCliff, held::kCliff, StopCause::kCliff},
               {PeripheralKind::kStageFault, held::kFaultInput, StopCause::kFaultInput}};
  for (const auto& one : kinds) {
    SensorBench bench(
        list_of({{.kind = one.kind, .flags = peripheralflag::kTriggeredLow, .pin_a = 36}}));
    bench.set_level(0, true);
    bench.open();
    CHECK(hold_of(bench).held == 0);
    bench.drive_on(0.2f, 0.2f, 200);
    bench.set_level(0, false);
    bench.step();
    const Hold hold = hold_of(bench);
    CHECK(hold.held == (one.flag | held::kFault));
    CHECK(hold.stop_cause == one.cause && hold.stop_held == one.flag);
  }
}

TEST(an_empty_battery_is_named_and_so_is_one_that_is_not_measured) {
  SensorBench bench(list_of({battery(7200, 7000, 6600)}));
  bench.open();
  bench.drive_on(0.2f, 0.2f, 100);
  bench.battery.measured_mv = 6000;
  bench.drive_on(0.2f, 0.2f, 2100);
  Hold hold = hold_of(bench);
  CHECK(hold.held == (held::kBattery | held::kFault) && hold.stop_cause == StopCause::kBattery);
  SensorBench broken(list_of({battery(7200, 7000, 6600)}));
  broken.open();
  broken.battery.measured_mv = 0;
  broken.run(200);
  hold = hold_of(broken);
  CHECK(hold.held == held::kBatteryUnknown);
}

// --- what ended the last motion ------------------------------------------------------------------

TEST(a_deadline_is_named_with_its_command_speed_and_distance) {
  OpenRobot bench;
  drive_on(bench);
  const uint32_t command = bench.command_seq;
  bench.roll(298);
  CHECK(bench.state() == SupervisorState::kDriving);
  bench.turn(1, 1);
  bench.step();
  CHECK(bench.state() == SupervisorState::kTimedOut);
  const uint64_t stop_us = bench.now_us;
  Hold hold = hold_of(bench);
  CHECK(hold.stop_cause == StopCause::kDeadline && hold.stop_command == command);
  CHECK(hold.stop_session == bench.session_id() && hold.stop_us == stop_us);
  CHECK(hold.stop_mmps > 100 && hold.stop_flags == 0 && hold.stop_held == 0);
  bench.roll(100);
  bench.run(700);
  hold = hold_of(bench);
  CHECK(hold.stop_flags == stopflag::kAtRest);
  const double mm_per_tick = 2e3 * std::numbers::pi *
                             bench.device.parameter(ParameterId::kWheelRadius) /
                             bench.device.parameter(ParameterId::kCountsPerRevolution);
  CHECK(hold.rolled_mm == static_cast<int>(100 * mm_per_tick));
  CHECK(hold.stop_us == stop_us);
}

TEST(a_stop_is_named_by_who_asked_for_it) {
  const struct {
    StopCause cause;
    void (*end)(RobotBench&);
  } ends[] = {
      {StopCause::kStop, [](RobotBench& bench) { bench.send(bench.stop()); }},
      {StopCause::kStopOther, [](RobotBench& bench) { bench.send(Stop{}); }},
      {StopCause::kEstopSession,
       [](RobotBench& bench) { bench.send(Estop{.session_id = bench.session_id()}); }},
      {StopCause::kEstopOther, [](RobotBench& bench) { bench.send(Estop{}); }},
      {StopCause::kEstopContact, [](RobotBench& bench) { bench.contact.open = true; }},
      {StopCause::kTrialEnded,
       [](RobotBench& bench) {
         bench.ask<Ack>(ParameterTrial{.action = TrialAction::kBegin, .timeout_s = 10.0f});
         bench.ask<Ack>(ParameterTrial{.action = TrialAction::kRevert});
       }},
  };
  for (const auto& one : ends) CHECK(stopped_by(one.end).stop_cause == one.cause);
}

TEST(a_program_that_loses_its_session_is_named) {
  OpenRobot bench;
  drive_on(bench);
  const uint32_t session = bench.session_id();
  const uint32_t command = bench.command_seq;
  bench.send(RobotBench::hello(0x777));
  bench.step();
  bench.run(1);
  bool reported = false;
  for (const Hold& hold : bench.of<Hold>()) {
    if (hold.session_id != (0x777 ^ RobotBench::kBootId)) continue;
    reported = true;
    CHECK(hold.stop_cause == StopCause::kNewSession);
    CHECK(hold.stop_session == session && hold.stop_command == command);
  }
  CHECK(reported);  // without having been asked
  OpenRobot gone;
  drive_on(gone);
  gone.device.hang_up(gone.now_us);
  gone.connect();
  CHECK(hold_of(gone).stop_cause == StopCause::kHangUp);
}

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

// --- how it is reported
// ---------------------------------------------------------------------------

TEST(each_change_is_reported_soon_and_what_lasts_each_second) {
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
}

TEST(inputs_that_chatter_do_not_fill_the_line) {
  SensorBench bench(bumpers());
  bench.open();
  bench.received.clear();
  for (int i = 0; i < 2000; ++i) {
    bench.set_level(0, i / 80 % 2 == 0);
    bench.step();
  }
  CHECK(bench.of<Hold>().size() >= 10 && bench.of<Hold>().size() <= 20);
}

TEST(nothing_is_reported_without_a_session) {
  SensorBench bench(bumpers());
  bench.start();
  bench.set_level(0, true);
  bench.run(2000);
  CHECK(bench.received.empty());
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
