// Stops, faults, the e-stop, and what may change during them, at the robot's pins.
#include "check.hpp"
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using test::OpenRobot;
using test::RobotBench;

namespace {

/// A value other than the active one, within the parameter's bounds and without contradicting
/// others.
float another_value(const ParameterSpec& spec) {
  if (spec.id == kNominalSupplyV || spec.id == kUnmeasuredSupplyV) return spec.maximum;
  return spec.default_value == spec.minimum ? spec.maximum : spec.minimum;
}

template <typename Visit>
void for_each_parameter(Visit&& visit) {
  for (const ParameterSpec& spec : kParameters) visit(spec);
}

}  // namespace

// --- a stop that slews ---------------------------------------------------------------------------

TEST(a_stop_in_a_step_leaves_enable_low_for_a_whole_period) {
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f);
  CHECK(bench.driven());
  bench.send(bench.stop(StopMode::kBrake));
  bench.step();
  CHECK(bench.left.enable == 0);
  bench.run(3);
  CHECK(bench.left.brakes() && bench.right.brakes());
  CHECK(bench.left.shortest_pause_us >= RobotBench::kPeriodUs);
  CHECK(bench.right.shortest_pause_us >= RobotBench::kPeriodUs);
}

TEST(a_stop_between_two_steps_leaves_enable_low_for_a_whole_period) {
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f);
  bench.now_us += 969;
  bench.send(bench.stop(StopMode::kBrake));
  bench.service();
  CHECK(!bench.driven() && bench.left.enable == 0);
  bench.step(31);
  bench.run(3);
  CHECK(bench.left.brakes() && bench.right.brakes());
  CHECK(bench.left.shortest_pause_us >= RobotBench::kPeriodUs);
  CHECK(!bench.left.switched_under_current);
}

TEST(a_stop_and_a_reversal_in_one_read_leave_enable_low_for_a_whole_period) {
  for (const bool twice : {false, true}) {
    OpenRobot bench;
    bench.send(bench.duty(20'000, 20'000));
    bench.run(100);
    CHECK(bench.left.duty() > 10'000);
    bench.now_us += 969;
    bench.send(bench.stop(StopMode::kBrake));
    bench.send(bench.duty(-20'000, -20'000));
    if (twice) {
      bench.send(bench.stop(StopMode::kBrake));
      bench.send(bench.duty(-20'000, -20'000));
    }
    bench.service();
    bench.step(31);
    bench.run(10);
    CHECK(bench.left.duty() < 0 && bench.right.duty() < 0);
    CHECK(bench.left.shortest_pause_us >= RobotBench::kPeriodUs);
    CHECK(!bench.left.switched_under_current);
  }
}

TEST(a_deadline_brakes_as_configured_after_a_period_with_enable_low) {
  OpenRobot bench;
  bench.send(bench.velocity(0.2f, 0.2f, 50'000));
  bench.run(49);
  CHECK(bench.driven());
  bench.step();
  CHECK(!bench.driven() && bench.state() == SupervisorState::kTimedOut);
  bench.run(2);
  CHECK(bench.left.brakes() && bench.right.brakes());
  CHECK(bench.left.shortest_pause_us == RobotBench::kPeriodUs);
  bench.run(1000);
  CHECK(!bench.left.brakes() && bench.left.enable == 0);
}

// --- parameters ----------------------------------------------------------------------------------

TEST(every_parameter_says_when_it_may_change_and_is_refused_otherwise) {
  for_each_parameter([](const ParameterSpec& spec) {
    using enum RefusalCode;
    const float value = another_value(spec);
    RobotBench idle;
    idle.open();
    CHECK(idle.set(spec.id, value) == kNone);

    RobotBench driving;
    driving.open().drive(0.1f, 0.1f);
    const bool always = spec.changes == ParameterChanges::kAlways;
    CHECK(driving.set(spec.id, value) == (always ? kNone : kNotStopped));
    CHECK(driving.set(spec.id, always ? value : spec.default_value) == kNone);
    CHECK(driving.state() == SupervisorState::kDriving);

    RobotBench latched;
    latched.open().send(Estop{});
    latched.step();
    const bool refused = spec.changes == ParameterChanges::kReleased;
    CHECK(latched.set(spec.id, value) == (refused ? kNotStopped : kNone));
    CHECK(latched.set(spec.id, refused ? spec.default_value : value) == kNone);
  });
}

TEST(what_must_not_change_while_driving_does_not_change_while_a_wheel_turns_either) {
  for_each_parameter([](const ParameterSpec& spec) {
    OpenRobot bench;
    for (int i = 0; i < 20; ++i) {
      bench.turn(0, -1);
      bench.run(5);
    }
    CHECK(bench.state() == SupervisorState::kIdle);
    const bool always = spec.changes == ParameterChanges::kAlways;
    CHECK(bench.set(spec.id, another_value(spec)) ==
          (always ? RefusalCode::kNone : RefusalCode::kNotStopped));
    CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kNotStopped);
    bench.run(600);
    CHECK(bench.set(spec.id, another_value(spec)) == RefusalCode::kNone);
    CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kNone);
  });
}

TEST(the_moment_between_two_drives_lets_no_geometry_in) {
  OpenRobot bench;
  for (int i = 0; i < 50; ++i) {
    bench.turn(1, 1);
    bench.drive(0.3f, 0.3f, 2);
  }
  bench.send(bench.stop());
  bench.step();
  CHECK(bench.state() == SupervisorState::kIdle);
  CHECK(bench.set(kWheelRadius, 0.05f) == RefusalCode::kNotStopped);
}

TEST(an_encoder_that_toggles_on_an_edge_keeps_no_parameter_from_changing) {
  OpenRobot bench;
  for (int i = 0; i < 20; ++i) {
    bench.turn(i % 2 == 0 ? 1 : -1, 0);
    bench.run(5);
  }
  CHECK(bench.set(kWheelRadius, 0.05f) == RefusalCode::kNone);
}

TEST(no_parameter_changes_before_the_saved_ones_are_loaded) {
  RobotBench bench;
  bench.send(RobotBench::hello(RobotBench::kNonce));
  bench.service();
  CHECK(bench.set(kMaxDuty, 0.5f) == RefusalCode::kBooting);
  CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kBooting);
  CHECK(bench.refusal(ParameterSave{}) == RefusalCode::kBooting);
}

TEST(what_must_not_change_while_driving_is_exactly_this) {
  for_each_parameter([](const ParameterSpec& spec) {
    switch (spec.id) {
      case kEstopInputEnabled:
        return CHECK(spec.changes == ParameterChanges::kReleased);
      case kWheelRadius:
      case kWheelSeparation:
      case kCountsPerRevolution:
      case kControlRateHz:
      case kTtlMaxS:
      case kStopMode:
      case kBrakeTimeS:
      case kStallDuty:
      case kStallTimeS:
      case kReversalDuty:
      case kReversalVelocityMps:
      case kOverrunLimitUs:
      case kLeftMotorInverted:
      case kRightMotorInverted:
      case kLeftEncoderInverted:
      case kRightEncoderInverted:
      case kRearmGapS:
        return CHECK(spec.changes == ParameterChanges::kStopped);
      default:
        return;
    }
  });
}

TEST(an_open_contact_cannot_be_switched_off) {
  OpenRobot bench;
  bench.contact.open = true;
  bench.step();
  CHECK(bench.state() == SupervisorState::kEstopped);
  CHECK(bench.set(kEstopInputEnabled, 0) == RefusalCode::kNotStopped);
  CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kNotStopped);
  CHECK(bench.clear_estop() == RefusalCode::kCausePresent);
  bench.drive(0.2f, 0.2f);
  CHECK(!bench.driven());
}

TEST(a_contact_that_was_closed_for_a_moment_while_it_was_cleared_latches_again) {
  OpenRobot bench;
  bench.contact.open = true;
  bench.run(2);
  bench.contact.open = false;
  CHECK(bench.clear_estop() == RefusalCode::kNone);  // Between two steps.
  bench.contact.open = true;
  bench.step();
  CHECK(bench.state() == SupervisorState::kEstopped);
}

TEST(a_contact_that_opened_since_the_last_step_cannot_be_switched_off) {
  for (const bool reset : {false, true}) {
    OpenRobot bench;
    bench.contact.open = true;
    CHECK((reset ? bench.refusal(ParameterReset{}) : bench.set(kEstopInputEnabled, 0)) ==
          RefusalCode::kNotStopped);
    CHECK(bench.state() == SupervisorState::kEstopped);
  }
}

TEST(a_closed_contact_can_be_switched_off_and_is_then_ignored) {
  OpenRobot bench;
  CHECK(bench.set(kEstopInputEnabled, 0) == RefusalCode::kNone);
  bench.contact.open = true;
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(parameters_are_neither_saved_nor_reset_while_driving) {
  RobotBench bench;
  bench.open().drive(0.1f, 0.1f);
  CHECK(bench.refusal(ParameterSave{}) == RefusalCode::kNotStopped);
  CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kNotStopped);
  CHECK(bench.store.block.empty());
  bench.send(bench.stop());
  bench.step();
  CHECK(bench.refusal(ParameterSave{}) == RefusalCode::kNone);
  CHECK(!bench.store.block.empty());
  const std::vector<uint8_t> saved = bench.store.block;
  CHECK(bench.refusal(ParameterReset{}) == RefusalCode::kNone);
  CHECK(bench.store.block.size() < saved.size());
}

TEST(an_estopped_robot_may_be_saved) {
  RobotBench bench;
  bench.open().send(Estop{});
  bench.step();
  CHECK(bench.refusal(ParameterSave{}) == RefusalCode::kNone);
}

TEST(a_limit_that_changes_while_driving_holds_from_the_next_step_on) {
  OpenRobot bench;
  bench.send(bench.duty(20'000, -20'000));
  bench.run(100);
  CHECK(bench.left.duty() == 20'000 && bench.right.duty() == -20'000);
  CHECK(bench.set(kMaxDuty, 0.5f) == RefusalCode::kNone);
  CHECK(bench.left.duty() == 20'000);
  bench.run(40);
  CHECK(bench.left.duty() == 16'384 && bench.right.duty() == -16'384);
  CHECK(bench.set(kMaxDuty, 1.0f) == RefusalCode::kNone);
  bench.run(40);
  CHECK(bench.left.duty() == 20'000);
}

TEST(a_limit_that_is_lowered_while_driving_keeps_the_ratio_of_the_wheels) {
  OpenRobot bench;
  bench.send(bench.duty(20'000, -10'000));
  bench.run(100);
  CHECK(bench.left.duty() == 20'000 && bench.right.duty() == -10'000);
  CHECK(bench.set(kMaxDuty, 0.5f) == RefusalCode::kNone);
  bench.run(40);
  // 0.5 of 32767, and half of it.
  CHECK(bench.left.duty() == 16'384 && magnitude(bench.right.duty() + 8192) <= 1);
}

TEST(a_limit_that_is_read_in_a_control_step_holds_from_the_next_one_on) {
  OpenRobot bench;
  bench.send(bench.duty(20'000, 20'000));
  bench.run(100);
  bench.send(
      ParameterSet{bench.session_id(), ++bench.request_id, static_cast<uint8_t>(kMaxDuty), 0.5f});
  bench.step();
  CHECK(bench.of<ParameterValue>().size() == 1);
  CHECK(bench.left.duty() == 20'000);
  bench.step();
  CHECK(bench.left.duty() < 20'000 && bench.right.duty() < 20'000);
}

TEST(a_limit_and_a_setpoint_in_one_read_are_taken_in_their_order) {
  for (const bool driving : {false, true}) {
    OpenRobot bench;
    if (driving) bench.drive(0.1f, 0.1f);
    bench.send(
        ParameterSet{bench.session_id(), ++bench.request_id, static_cast<uint8_t>(kMaxDuty), 0.5f});
    bench.send(bench.duty(30'000, 30'000));
    bench.service();
    bench.run(100);
    CHECK(bench.left.duty() == 16'384);
  }
}

// --- faults --------------------------------------------------------------------------------------

TEST(a_fault_of_one_step_is_told_and_counted_though_clears_are_waiting) {
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f);
  bench.received.clear();
  for (int i = 0; i < 3; ++i) bench.send(ClearFault{bench.session_id(), ++bench.request_id});
  bench.step(50'000);  // CONTROL_OVERRUN
  CHECK(!bench.driven());
  const auto events = bench.of<Event>();
  CHECK(events.size() == 2);
  CHECK(events[0].after == SupervisorState::kFault);
  CHECK(events[0].faults == fault::kControlOverrun);
  CHECK(events[1].after == SupervisorState::kIdle);
  CHECK(bench.of<Ack>().size() == 3);
  CHECK(bench.ask<LinkCounters>(LinkCountersGet{})->faults_tripped == 1);
}

TEST(a_fault_is_counted_once_however_long_it_lasts) {
  OpenRobot bench;
  bench.device.report_driver_failure();
  bench.run(10);
  CHECK(bench.state() == SupervisorState::kFault);
  CHECK(bench.clear_fault() == RefusalCode::kCausePresent);
  CHECK(bench.ask<LinkCounters>(LinkCountersGet{})->faults_tripped == 1);
}

TEST(a_fault_below_an_estop_latches_at_once_when_that_is_cleared) {
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f);
  bench.step(50'000);
  bench.send(Estop{});
  bench.step();
  CHECK(bench.state() == SupervisorState::kEstopped);
  bench.send(ClearEstop{bench.session_id(), ++bench.request_id});
  bench.send(bench.velocity(0.2f, 0.2f));
  bench.service();
  CHECK(bench.state() == SupervisorState::kFault);
  CHECK(bench.of<Refuse>().back().code == RefusalCode::kFault);
  bench.step();
  CHECK(!bench.driven());
}

TEST(a_correction_that_is_switched_off_while_driving_is_slewed_away) {
  constexpr int32_t kSlewUmps = 1500;  // 1.5 m/s^2 at 1 kHz.
  OpenRobot bench;
  CHECK(bench.set(kPathGain, 0) == RefusalCode::kNone);
  CHECK(bench.set(kPathCatchUp, 0.1f) == RefusalCode::kNone);
  // The left wheel stays behind, and the heading is corrected.
  for (int i = 0; i < 250; ++i) {
    bench.turn(0, i % 2);
    bench.drive(0.3f, 0.2f, 1);
  }
  const WheelPair corrected = bench.device.commanded();
  CHECK(corrected.left > 300'000 + 5 * kSlewUmps);
  CHECK(bench.set(kHeadingGain, 0) == RefusalCode::kNone);
  int32_t before = corrected.left;
  for (int i = 0; i < 40; ++i) {
    bench.drive(0.3f, 0.2f, 1);
    const int32_t now = bench.device.commanded().left;
    CHECK(before - now <= kSlewUmps && now <= before);
    before = now;
  }
  CHECK(before == 300'000);
}

// --- extremes ------------------------------------------------------------------------------------

/// With sanitizers: each sum of values from the wire, a parameter or a counter stays within its
/// type.
TEST(the_fastest_wheel_and_the_steepest_slew_overflow_nothing) {
  for (const int ticks : {16'000, -16'000}) {
    OpenRobot bench;
    CHECK(bench.set(kGlitchFilterNs, 0) == RefusalCode::kNone);
    CHECK(bench.set(kCountsPerRevolution, 4) == RefusalCode::kNone);
    CHECK(bench.set(kWheelRadius, 1.0f) == RefusalCode::kNone);
    CHECK(bench.set(kMaxAccelerationMps2, 100.0f) == RefusalCode::kNone);
    for (int i = 0; i < 400; ++i) {
      const int register_value = bench.encoders.counts.left + ticks;
      bench.encoders.counts.left = static_cast<int16_t>(register_value % kCounterLimit);
      bench.encoders.counts.right = bench.encoders.counts.left;
      if (i < 200) {
        bench.step();
        continue;
      }
      bench.send(bench.velocity(ticks > 0 ? -10.0f : 10.0f, ticks > 0 ? -10.0f : 10.0f));
      bench.step();
    }
    CHECK(bench.driven() || bench.device.faults() != 0);
  }
}

TEST(a_parameter_and_the_first_setpoint_in_one_step_leave_its_duty) {
  int duties[2];
  for (const bool sets : {false, true}) {
    OpenRobot bench;
    const ParameterSet set{bench.session_id(), ++bench.request_id, static_cast<uint8_t>(kMaxDuty),
                           0.9f};
    if (sets) bench.send(set);
    bench.send(bench.velocity(0.2f, 0.2f));
    bench.run(2);
    duties[sets] = bench.left.duty();
  }
  CHECK(duties[0] > 0 && duties[0] == duties[1]);
}
