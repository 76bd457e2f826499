// Stops, faults, the e-stop, and what may change during them, at the robot's pins.
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

namespace {

const ParameterSpec& spec_of(ParameterId id) { return kParameters[static_cast<size_t>(id) - 1]; }

/// A value other than the active one, within the parameter's bounds and without contradicting
/// others.
float another_value(const ParameterSpec& spec) {
  if (spec.id == kNominalSupplyV || spec.id == kUnmeasuredSupplyV) return spec.maximum;
  return spec.default_value == spec.minimum ? spec.maximum : spec.minimum;
}

RefusalCode refused_unless(bool may_change) {
  return may_change ? RefusalCode::kNone : RefusalCode::kNotStopped;
}

}  // namespace

// --- a stop that slews ---------------------------------------------------------------------------

TEST(a_stop_and_a_reversal_in_one_read_leave_enable_low_for_a_whole_period) {
  for (const int times : {1, 2}) {
    OpenRobot bench;
    bench.drive_duty(20'000, 20'000);
    CHECK(bench.left.duty() > 10'000);
    bench.now_us += 969;
    for (int i = 0; i < times; ++i) {
      bench.send(bench.stop(StopMode::kBrake));
      bench.send(bench.duty(-20'000, -20'000));
    }
    bench.service();
    bench.step(31);
    bench.run(10);
    CHECK(bench.left.duty() < 0 && bench.right.duty() < 0 && bench.switched_gently());
  }
}

// --- parameters ----------------------------------------------------------------------------------

TEST(every_parameter_says_when_it_may_change_and_is_refused_otherwise) {
  for (const ParameterSpec& spec : kParameters) {
    const float value = another_value(spec);
    CHECK(OpenRobot().set(spec.id, value) == RefusalCode::kNone);

    DrivingRobot driving;
    const bool always = spec.changes == ParameterChanges::kAlways;
    CHECK(driving.set(spec.id, value) == refused_unless(always));
    CHECK(driving.set(spec.id, always ? value : spec.default_value) == RefusalCode::kNone);
    CHECK(driving.refusal(ParameterSave{}) == RefusalCode::kNotStopped);
    CHECK(driving.state() == SupervisorState::kDriving);

    OpenRobot latched;
    latched.estop();
    const bool may_change = spec.changes != ParameterChanges::kReleased;
    CHECK(latched.set(spec.id, value) == refused_unless(may_change));
    CHECK(latched.set(spec.id, may_change ? value : spec.default_value) == RefusalCode::kNone);

    OpenRobot turning;
    for (int i = 0; i < 20; ++i) {
      turning.turn(0, -1);
      turning.run(5);
    }
    CHECK(turning.state() == SupervisorState::kIdle);
    CHECK(turning.set(spec.id, value) == refused_unless(always));
    CHECK(turning.refusal(ParameterReset{}) == RefusalCode::kNotStopped);
    turning.run(600);
    CHECK(turning.set(spec.id, value) == RefusalCode::kNone);
    CHECK(turning.refusal(ParameterReset{}) == RefusalCode::kNone);
  }
}

TEST(an_encoder_that_toggles_on_an_edge_keeps_no_parameter_from_changing) {
  OpenRobot bench;
  for (int i = 0; i < 20; ++i) {
    bench.turn(i % 2 == 0 ? 1 : -1, 0);
    bench.run(5);
  }
  CHECK(bench.set(kWheelRadius, 0.05f) == RefusalCode::kNone);
}

TEST(what_must_not_change_while_driving_is_at_least_this) {
  for (const ParameterId id :
       {kWheelRadius, kWheelSeparation, kCountsPerRevolution, kControlRateHz, kTtlMaxS, kStopMode,
        kBrakeTimeS, kStallDuty, kStallTimeS, kReversalDuty, kReversalVelocityMps, kOverrunLimitUs,
        kLeftMotorInverted, kRightMotorInverted, kLeftEncoderInverted, kRightEncoderInverted,
        kMotorsSwapped, kEncodersSwapped, kRearmGapS})
    CHECK(spec_of(id).changes == ParameterChanges::kStopped);
  CHECK(spec_of(kEstopInputEnabled).changes == ParameterChanges::kReleased);
}

TEST(an_open_contact_cannot_be_switched_off_even_before_a_step_has_read_it) {
  for (const bool resets : {false, true}) {
    OpenRobot bench;
    bench.contact.open = true;
    for (int i = 0; i < 2; ++i) {
      CHECK((resets ? bench.refusal(ParameterReset{}) : bench.set(kEstopInputEnabled, 0)) ==
            RefusalCode::kNotStopped);
      CHECK(bench.state() == SupervisorState::kEstopped);
      bench.step();
    }
    CHECK(bench.clear_estop() == RefusalCode::kCausePresent);
    bench.drive(0.2f, 0.2f);
    CHECK(!bench.driven());
  }
}

TEST(a_closed_contact_can_be_switched_off_and_is_then_ignored) {
  OpenRobot bench;
  CHECK(bench.set(kEstopInputEnabled, 0) == RefusalCode::kNone);
  bench.contact.open = true;
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(a_limit_that_changes_while_driving_holds_for_both_wheels_and_keeps_their_ratio) {
  for (const int16_t right : {int16_t{-20'000}, int16_t{-10'000}}) {
    OpenRobot bench;
    bench.drive_duty(20'000, right);
    CHECK(bench.left.duty() == 20'000 && bench.right.duty() == right);
    CHECK(bench.set(kMaxDuty, 0.5f) == RefusalCode::kNone);
    CHECK(bench.left.duty() == 20'000);
    bench.run(40);
    // 0.5 of 32767, and its part.
    CHECK(bench.left.duty() == 16'384);
    const int rounding = right == -20'000 ? 0 : 1;
    CHECK(magnitude(bench.right.duty() - right * 16'384 / 20'000) <= rounding);
    CHECK(bench.set(kMaxDuty, 1.0f) == RefusalCode::kNone);
    bench.run(40);
    CHECK(bench.left.duty() == 20'000 && bench.right.duty() == right);
  }
}

TEST(a_limit_that_is_read_in_a_control_step_holds_from_the_next_one_on) {
  OpenRobot bench;
  bench.drive_duty(20'000, 20'000);
  bench.send(
      ParameterSet{bench.session_id(), ++bench.request_id, static_cast<uint8_t>(kMaxDuty), 0.5f});
  bench.step();
  CHECK(bench.of<ParameterValue>().size() == 1);
  CHECK(bench.left.duty() == 20'000);
  bench.step();
  CHECK(bench.left.duty() < 20'000 && bench.right.duty() < 20'000);
}

// --- faults --------------------------------------------------------------------------------------

TEST(a_fault_of_one_step_is_told_and_counted_though_clears_are_waiting) {
  DrivingRobot bench;
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
  DrivingRobot bench;
  bench.step(50'000);
  bench.estop();
  CHECK(bench.state() == SupervisorState::kEstopped);
  bench.send(ClearEstop{bench.session_id(), ++bench.request_id});
  bench.send(bench.velocity(0.2f, 0.2f));
  bench.service();
  CHECK(bench.state() == SupervisorState::kFault);
  CHECK(bench.last_refusal() == RefusalCode::kFault);
  bench.step();
  CHECK(!bench.driven() && bench.device.faults() == fault::kControlOverrun);
  CHECK(bench.clear_fault() == RefusalCode::kNone && bench.state() == SupervisorState::kIdle);
}

// --- extremes ------------------------------------------------------------------------------------

/// With sanitizers: each sum of values from the wire, a parameter or a counter stays within its
/// type.
TEST(the_fastest_wheel_and_the_steepest_slew_overflow_nothing) {
  for (const int ticks : {16'000, -16'000}) {
    OpenRobot bench;
    bench.configure({{kGlitchFilterNs, 0},
                     {kCountsPerRevolution, 4},
                     {kWheelRadius, 1},
                     {kMaxAccelerationMps2, 100}});
    for (int i = 0; i < 400; ++i) {
      const int register_value = bench.encoders.counts.left + ticks;
      bench.encoders.counts.left = static_cast<int16_t>(register_value % kCounterLimit);
      bench.encoders.counts.right = bench.encoders.counts.left;
      const float mps = ticks > 0 ? -10.0f : 10.0f;
      if (i >= 200) bench.send(bench.velocity(mps, mps));
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
    bench.drive(0.2f, 0.2f, 2);
    duties[sets] = bench.left.duty();
  }
  CHECK(duties[0] > 0 && duties[0] == duties[1]);
}
