// Sessions, setpoints, requests and driving of a whole robot, at its pins and on its line.
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

namespace {

constexpr uint64_t k32Bits = 1ull << 32;

}  // namespace

// --- sessions, stops -----------------------------------------------------------------------------

TEST(a_repeated_and_a_foreign_hello_change_nothing_and_a_new_session_stops) {
  DrivingRobot bench;
  bench.send(RobotBench::hello(RobotBench::kNonce));
  Hello foreign = RobotBench::hello(7);
  foreign.schema_hash ^= 1;
  bench.send(foreign);
  foreign.protocol_version += 1;
  bench.send(foreign);
  bench.step();
  const auto answers = bench.of<DeviceHello>();
  CHECK(answers.size() == 3 && answers[0].refusal == RefusalCode::kNone);
  CHECK(answers[1].refusal == RefusalCode::kSchema);
  CHECK(answers[2].refusal == RefusalCode::kProtocolVersion);
  CHECK(bench.state() == SupervisorState::kDriving && bench.driven());
  CHECK(bench.newest_state().command_seq == bench.command_seq);
  bench.send(RobotBench::hello(RobotBench::kNonce + 1));
  bench.step();
  CHECK(!bench.driven() && bench.state() == SupervisorState::kIdle);
  CHECK(bench.device.deadline_us() == 0 && bench.newest_state().command_seq == 0);
  bench.send(bench.velocity(0.2f, 0.2f));  // of the previous session
  bench.step();
  CHECK(bench.last_refusal() == RefusalCode::kNoSession);
}

TEST(the_clock_is_synchronised_by_a_ping_of_this_session_only) {
  RobotBench bench;
  bench.start();
  bench.send(RobotBench::hello(RobotBench::kNonce));
  bench.send(Ping{bench.session_id() + 1, 1, 0});
  bench.drive(0.2f, 0.2f, 5);
  CHECK(bench.of<Refuse>()[0].code == RefusalCode::kNoSession);
  CHECK(bench.of<Refuse>()[1].code == RefusalCode::kClockUnsynchronised);
  CHECK(!bench.driven());
}

TEST(stop_and_estop_act_in_any_session) {
  for (const bool latched : {false, true}) {
    DrivingRobot bench;
    if (latched) {
      bench.send(Estop{99, 1});
    } else {
      bench.send(Stop{99, 1, 0, StopMode::kCoast});
    }
    bench.service();
    CHECK(!bench.driven());
    CHECK(bench.of<Ack>().back().session_id == 99);
    CHECK(bench.state() == (latched ? SupervisorState::kEstopped : SupervisorState::kIdle));
  }
}

TEST(a_stop_of_this_session_alone_voids_what_was_sent_before_it) {
  OpenRobot bench;
  bench.send(Stop{99, 1, 0xffffffff, StopMode::kCoast});
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
  const SetWheelVelocity late = bench.velocity(0.2f, 0.2f);
  bench.send(bench.stop());
  bench.send(late);
  bench.run(5);
  CHECK(!bench.driven());
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(a_stop_brakes_or_coasts_as_asked_or_as_configured) {
  struct Case {
    uint8_t mode;
    float configured;
    bool brakes;
  };
  for (const auto& [mode, configured, brakes] :
       {Case{0, 1, false}, Case{0, 2, true}, Case{1, 2, false}, Case{2, 1, true}, Case{9, 1, false},
        Case{9, 2, true}}) {
    OpenRobot bench;
    CHECK(bench.set(kStopMode, configured) == RefusalCode::kNone);
    bench.drive(0.2f, 0.2f);
    bench.send(bench.stop(static_cast<StopMode>(mode)));
    bench.run(5);
    CHECK(bench.left.brakes() == brakes && bench.right.brakes() == brakes && !bench.driven());
  }
}

// --- setpoints -----------------------------------------------------------------------------------

TEST(a_setpoint_drives_until_it_expires_and_for_ttl_max_at_most) {
  for (const uint64_t start_us : {k32Bits - 20'000, 3 * k32Bits - 20'000, k32Bits * 5}) {
    RobotBench bench(start_us);
    bench.open().send(bench.velocity(0.2f, 0.2f, 50'000));
    bench.run(49);
    CHECK(bench.driven());
    bench.step();
    CHECK(!bench.driven() && bench.state() == SupervisorState::kTimedOut);
    CHECK(bench.set(kTtlMaxS, 0.1f) == RefusalCode::kNone);
    bench.send(bench.duty(9'000, 9'000, k32Bits + 50'000));
    bench.run(100);
    CHECK(bench.driven());
    bench.run(2);
    CHECK(!bench.driven());
    for (const uint64_t late_us : {uint64_t{0}, k32Bits - 50'000}) {
      SetWheelVelocity past = bench.velocity(0.2f, 0.2f);
      past.expiry_us = bench.now_us - late_us;
      bench.received.clear();
      bench.send(past);
      bench.service();
      CHECK(bench.of<Refuse>().size() == 1 && bench.last_refusal() == RefusalCode::kExpired);
    }
  }
}

TEST(numbers_that_are_not_finite_drive_neither_wheel) {
  for (const float bad : {__builtin_nanf(""), __builtin_inff(), -__builtin_inff()}) {
    OpenRobot bench;
    bench.send(bench.velocity(bad, 0.2f));
    bench.drive(0.2f, bad, 5);
    CHECK(bench.of<Refuse>().size() == 2);
    CHECK(!bench.driven());
  }
}

TEST(each_wheel_falls_to_a_lowered_max_duty_at_the_slew_limit) {
  OpenRobot bench;
  bench.drive_duty(32'767, 4'000);
  CHECK(bench.set(kMaxDuty, 0.1f) == RefusalCode::kNone);
  CHECK(bench.set(kMaxDutyRatePerS, 0.5f) == RefusalCode::kNone);
  bench.send(bench.duty(0, 32'767, 900'000));
  int32_t before = magnitude(bench.right.duty());
  CHECK(before > 3'277);
  for (int i = 0; i < 60 && before > 3'277; ++i) {
    bench.step();
    const int32_t now = magnitude(bench.right.duty());
    CHECK(now < before && before - now <= 17);
    before = now;
  }
  CHECK(before <= 3'277);
}

TEST(duty_that_begins_while_the_stage_pauses_begins_at_zero) {
  bool paused = false;
  for (int steps = 1; steps < 60; ++steps) {
    OpenRobot bench;
    bench.drive(0.3f, 0.3f);
    bench.drive(-0.3f, -0.3f, steps);
    const int before = bench.left.duty();
    bench.drive_duty(0, 0, 1);
    CHECK(magnitude(bench.left.duty()) <= magnitude(before) + 656);
    paused = paused || (before == 0 && bench.state() == SupervisorState::kDriving);
  }
  CHECK(paused);
}

TEST(duty_setpoints_slew_from_what_is_driven_and_from_zero_after_a_stop) {
  OpenRobot bench;
  bench.drive_duty(30'000, 30'000, 10);
  // 20 duty a second are 655 of 32767 a step.
  CHECK(magnitude(bench.left.duty() - 6'553) <= 10);
  CHECK(bench.left.duty() == bench.right.duty());
  bench.run(90);
  bench.send(bench.stop(StopMode::kCoast));
  bench.run(5);
  bench.drive_duty(30'000, 30'000, 3);
  CHECK(bench.left.duty() > 0 && bench.left.duty() <= 3 * 656);
  bench.drive(0.2f, 0.2f, 100);
  const int before = bench.left.duty();
  CHECK(before > 5'000);
  bench.drive_duty(0, 0, 1);
  CHECK(magnitude(bench.left.duty() - before) <= 656);
  CHECK(magnitude(bench.right.duty() - before) <= 656);
}

TEST(a_repeated_request_is_answered_and_not_done_again) {
  OpenRobot bench;
  const auto id = static_cast<uint8_t>(kMaxDuty);
  const ParameterSet first{bench.session_id(), ++bench.request_id, id, 0.5f};
  bench.send(first);
  CHECK(bench.set(kMaxDuty, 0.75f) == RefusalCode::kNone);
  bench.received.clear();
  bench.send(first);
  bench.service();
  CHECK(bench.of<ParameterValue>().size() == 1);
  CHECK(bench.of<ParameterValue>()[0].value == 0.5f);
  CHECK(bench.ask<ParameterValue>(ParameterGet{.parameter = id})->value == 0.75f);
}

// --- requests, the line --------------------------------------------------------------------------

TEST(a_stream_faster_than_the_loop_or_the_line_is_refused) {
  OpenRobot bench;
  CHECK(bench.refusal(SetStreamRate{.rate_hz = 1001}) == RefusalCode::kRateTooHigh);
  CHECK(bench.refusal(SetStreamRate{.rate_hz = 1000}) == RefusalCode::kNone);
  bench.line.rate = 11'520;
  const uint32_t fits = 11'520 * 4 / (5 * static_cast<uint32_t>(frame_size(WheelState::kSize)));
  CHECK(bench.refusal(SetStreamRate{.rate_hz = static_cast<uint16_t>(fits)}) == RefusalCode::kNone);
  CHECK(bench.refusal(SetStreamRate{.rate_hz = static_cast<uint16_t>(fits + 1)}) ==
        RefusalCode::kRateTooHigh);
}

TEST(a_late_step_is_a_fault_while_driving_only) {
  OpenRobot bench;
  bench.step(100'000);
  CHECK(bench.state() == SupervisorState::kIdle);
  bench.drive(0.2f, 0.2f);
  bench.step(20'000);
  CHECK(bench.state() == SupervisorState::kDriving);
  bench.step(20'001);
  CHECK(bench.state() == SupervisorState::kFault && !bench.driven());
  CHECK(bench.newest_state().overruns == 3);
}

TEST(a_line_that_babbles_and_one_without_room_hold_up_no_step) {
  OpenRobot bench;
  bench.line.to_device.assign(5'000, 0x55);
  bench.step();
  CHECK(bench.line.to_device.size() == 4'400);
  bench.step();
  CHECK(bench.line.to_device.size() == 3'800);
  bench.line.to_device.clear();
  bench.line.room = 0;
  bench.received.clear();
  bench.run(1000);
  bench.line.room = SIZE_MAX;
  bench.run(20);
  CHECK(bench.of<WheelState>().size() == 2);  // none of the second before
  const auto counted = bench.ask<LinkCounters>(LinkCountersGet{});
  CHECK(counted->send_dropped == 100 + 1);  // states, and what holds it
  // After a pause states do not come in a burst.
  bench.step(1'000'000);
  bench.received.clear();
  bench.run(100);
  CHECK(bench.of<WheelState>().size() == 10);
}

TEST(a_dropped_frame_leaves_a_gap_in_the_sequence) {
  BenchLine line;
  Link link(line);
  for (const size_t room : {SIZE_MAX, size_t{0}, size_t{0}, SIZE_MAX}) {
    line.room = room;
    link.send(Ack{1, 1, 1});
  }
  FrameDecoder decoder(body_size);
  Frame frame{};
  for (const uint8_t byte : line.to_host) decoder.feed(byte, frame);
  CHECK(decoder.counters().seq_lost == 2);
  CHECK(link.send_dropped() == 2 && link.frames_sent() == 2);
}

TEST(a_message_of_a_device_is_unknown_to_a_device) {
  OpenRobot bench;
  bench.send(Pong{});
  bench.service();
  CHECK(bench.ask<LinkCounters>(LinkCountersGet{})->unknown_id == 1);
}
