// What survives a reset, and what ends it.
#include "latches.hpp"

#include "memory_store.hpp"
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

namespace {

/// Why a setpoint is refused; kNone when it drives.
RefusalCode refusal_of_drive(RobotBench& bench, int steps = 20) {
  bench.drive(0.2f, 0.2f, steps);
  return bench.driven() ? RefusalCode::kNone : bench.last_refusal();
}

}  // namespace

TEST(latches_come_back_as_they_were) {
  for (const bool estop : {false, true}) {
    for (const uint32_t faults : {0u, 1u, 0xffffu}) {
      const Latches latches{.estop = estop,
                            .holds = !estop,
                            .battery_at_stop = faults == 1,
                            .faults = faults,
                            .source = estop ? EstopSource::kContact : EstopSource::kNone,
                            .moves = !estop,
                            .driver = faults + 7};
      const LastStop stop{.session = faults, .mmps = 200, .cause = StopCause::kDeadline};
      uint8_t record[Latches::kSize];
      latches.encode(record, stop);
      Latches found;
      LastStop found_stop;
      CHECK(Latches::decode(record, sizeof record, found, &found_stop) && found == latches);
      CHECK(found_stop == stop);
      for (uint8_t& byte : record) {
        byte ^= 16;
        CHECK(!Latches::decode(record, sizeof record, found));
        byte ^= 16;
      }
      CHECK(!Latches::decode(record, sizeof record - 1, found));
    }
  }
}

TEST(what_is_latched_survives_a_reset_with_its_flags_until_it_is_cleared) {
  using Latched = std::pair<bool, bool>;
  for (const auto& [estop, fault] :
       {Latched{true, false}, Latched{false, true}, Latched{true, true}}) {
    DrivingRobot first;
    if (fault) first.step(50'000);
    if (estop) first.estop();
    RobotBench second;
    second.survive_reset(first).open();
    CHECK(second.state() == (estop ? SupervisorState::kEstopped : SupervisorState::kFault));
    CHECK(second.device.faults() == (fault ? fault::kControlOverrun : 0));
    CHECK(refusal_of_drive(second) == (estop ? RefusalCode::kEstopped : RefusalCode::kFault));
    if (fault) CHECK(second.clear_fault() == RefusalCode::kNone);  // Below an e-stop, too.
    RobotBench third;
    third.survive_reset(second).open();
    CHECK(third.state() == (estop ? SupervisorState::kEstopped : SupervisorState::kIdle));
    CHECK(third.device.faults() == 0);
    if (estop) CHECK(third.clear_estop() == RefusalCode::kNone);
    RobotBench fourth;
    fourth.survive_reset(third).open();
    CHECK(fourth.state() == SupervisorState::kIdle);
  }
}

TEST(an_estop_survives_a_power_cut_once_the_wheels_stand) {
  DrivingRobot first;
  first.roll(50);
  first.send(Estop{});
  for (int i = 0; i < 20; ++i) {
    first.roll(1);
    CHECK(first.latch_store.block.empty());  // A write to flash never meets a turning wheel.
  }
  first.run(3000);
  CHECK(!first.latch_store.block.empty());
  RobotBench second;
  second.survive_power_cut(first).open();
  CHECK(second.state() == SupervisorState::kEstopped);
  second.run(3000);
  CHECK(second.clear_estop() == RefusalCode::kNone);
  RobotBench third;
  third.survive_power_cut(second).open();
  CHECK(third.state() == SupervisorState::kIdle);
}

TEST(a_wheel_that_turns_back_is_not_at_rest) {
  OpenRobot bench;
  bench.run(3000);
  bench.turn(1, 0);
  bench.send(Estop{});
  // Pushed back and forth: as it turns back its speed is 0 for a moment.
  for (int i = 0; i < 3000; ++i) {
    bench.turn(i / 40 % 2 == 0 ? 1 : -1, 0);
    bench.step();
    CHECK(bench.latch_store.block.empty());
  }
  bench.run(450);
  CHECK(bench.latch_store.block.empty());
  bench.run(100);
  CHECK(!bench.latch_store.block.empty());
}

TEST(a_wheel_whose_encoder_is_dead_has_time_to_run_down) {
  OpenRobot bench;
  bench.drive(0.2f, 0.2f, 100);
  bench.send(Estop{});
  bench.run(1990);
  CHECK(bench.state() == SupervisorState::kEstopped && bench.latch_store.block.empty());
  bench.run(20);
  CHECK(!bench.latch_store.block.empty());
}

TEST(an_estop_that_chatters_wears_no_flash) {
  OpenRobot bench;
  bench.run(3000);
  for (int i = 0; i < 3000; ++i) {
    bench.contact.open = true;
    bench.run(5);
    bench.contact.open = false;
    CHECK(bench.clear_estop() == RefusalCode::kNone);
    bench.run(5);
  }
  CHECK(bench.latch_store.saves >= 2 && bench.latch_store.saves <= 6);  // 30 s.
}

/// On a slope the wheels may turn for ever, too slowly to count as rolling.
TEST(an_estop_is_in_flash_although_the_robot_creeps_on_its_brake_but_not_while_it_rolls_or_coasts) {
  struct Case {
    bool coasts;
    int tick_every_ms;
    bool in_flash;
  };
  for (const auto& [coasts, tick_every_ms, in_flash] :
       {Case{false, 4, true}, Case{false, 2, false}, Case{true, 4, false}}) {
    OpenRobot bench;
    if (coasts) CHECK(bench.set(kEstopMode, 1) == RefusalCode::kNone);
    bench.drive(0.2f, 0.2f);
    bench.send(Estop{});
    for (int ms = 0; ms < 15'000; ++ms) {
      if (ms % tick_every_ms == 0) bench.turn(1, 1);  // 0.144 or 0.288 m/s
      bench.step();
      if (ms < 1900) CHECK(bench.latch_store.block.empty());
    }
    CHECK(bench.latch_store.block.empty() != in_flash);
  }
}

TEST(a_flash_that_cannot_be_written_is_not_tried_at_every_step) {
  RobotBench bench;
  bench.latch_store.failing = true;
  bench.open().send(Estop{});
  bench.run(3000);
  CHECK(bench.latch_store.block.empty());
  bench.latch_store.failing = false;
  bench.run(100);
  CHECK(bench.latch_store.block.empty());
  bench.run(10'000);
  CHECK(!bench.latch_store.block.empty());
}

TEST(a_block_that_cannot_be_read_is_an_estop) {
  RobotBench flash;
  flash.latch_store.block = {1, 2, 3};
  flash.open();
  CHECK(flash.state() == SupervisorState::kEstopped);
  CHECK(flash.clear_estop() == RefusalCode::kNone);
  flash.run(3000);
  RobotBench next;
  next.survive_power_cut(flash).open();
  CHECK(next.state() == SupervisorState::kIdle);
}

// --- after a clear -------------------------------------------------------------------------------

namespace {

/// E-stopped while a program drives, and cleared.
struct ClearedRobot : DrivingRobot {
  ClearedRobot() {
    send(Estop{});
    drive(0.2f, 0.2f);
    CHECK(clear_estop() == RefusalCode::kNone);
  }
};

}  // namespace

TEST(a_zero_setpoint_arms_and_an_expired_one_does_not) {
  for (const bool by_duty : {false, true}) {
    ClearedRobot bench;
    bench.send(bench.velocity(0.0f, 0.0f, 0));
    CHECK(refusal_of_drive(bench) == RefusalCode::kUnarmed);
    if (by_duty) bench.drive_duty(0, 0, 20);
    if (!by_duty) bench.drive(0.0f, 0.0f);
    CHECK(bench.state() == SupervisorState::kDriving && !bench.driven());
    bench.drive(0.2f, 0.2f);
    CHECK(bench.driven());
  }
}

TEST(a_gap_arms_and_starts_at_the_latest_setpoint) {
  for (const int gap_ms : {1000, 2000}) {
    ClearedRobot bench;
    CHECK(bench.set(kRearmGapS, static_cast<float>(gap_ms) / 1000) == RefusalCode::kNone);
    bench.run(gap_ms - 100);
    CHECK(refusal_of_drive(bench, 1) == RefusalCode::kUnarmed);
    bench.run(gap_ms - 2);
    CHECK(refusal_of_drive(bench, 1) == RefusalCode::kUnarmed);
    bench.run(gap_ms - 1);
    CHECK(refusal_of_drive(bench) == RefusalCode::kNone);
  }
}

TEST(a_setpoint_counts_as_having_come_whatever_it_is_refused_for) {
  enum { kUnsynchronised, kNotFinite, kNoSession, kExpired, kReasons };
  for (int reason = 0; reason < kReasons; ++reason) {
    ClearedRobot bench;
    if (reason == kUnsynchronised) bench.greet(RobotBench::kNonce + 1, false);
    for (int i = 0; i < 12; ++i) {
      SetWheelVelocity setpoint = bench.velocity(0.2f, 0.2f);
      if (reason == kNotFinite) setpoint.left_mps = __builtin_nanf("");
      if (reason == kNoSession) setpoint.session_id = 99;
      if (reason == kExpired) setpoint.expiry_us = 0;
      bench.send(setpoint);
      bench.run(50);
    }
    if (reason == kUnsynchronised) bench.send(Ping{bench.session_id(), 1, 0});
    CHECK(refusal_of_drive(bench, 5) == RefusalCode::kUnarmed);
  }
}

TEST(neither_a_stop_nor_a_new_session_arms) {
  ClearedRobot bench;
  bench.send(bench.stop());
  CHECK(refusal_of_drive(bench) == RefusalCode::kUnarmed);
  bench.greet(RobotBench::kNonce + 1);
  CHECK(refusal_of_drive(bench) == RefusalCode::kUnarmed);
}

TEST(a_clear_with_nothing_to_clear_disarms_nothing) {
  DrivingRobot bench;
  CHECK(bench.clear_estop() == RefusalCode::kNone && bench.clear_fault() == RefusalCode::kNone);
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

/// As long as a setpoint may live the program may still be driving.
TEST(no_program_drives_on_by_itself_whatever_the_gap_is) {
  for (const float gap_s : {0.0f, 0.5f}) {
    for (const int period_ms : {20, 550, 600, 700, 800, 900, 990}) {
      OpenRobot bench;
      CHECK(bench.set(kRearmGapS, gap_s) == RefusalCode::kNone);
      bench.drive(0.2f, 0.2f);
      bench.estop();
      CHECK(bench.clear_estop() == RefusalCode::kNone);
      for (int i = 0; i < 5; ++i) {
        CHECK(refusal_of_drive(bench, period_ms) == RefusalCode::kUnarmed);
      }
    }
  }
}

TEST(turning_about_one_wheel_does_not_arm) {
  using Wheels = std::pair<float, float>;
  for (const auto& [left, right] : {Wheels{0.0f, 0.2f}, Wheels{0.2f, 0.0f}, Wheels{-0.2f, 0.0f}}) {
    ClearedRobot bench;
    bench.drive(left, right);
    CHECK(!bench.driven() && bench.last_refusal() == RefusalCode::kUnarmed);
    bench.drive_duty(static_cast<int16_t>(left * 45'000), static_cast<int16_t>(right * 45'000), 20);
    CHECK(!bench.driven() && bench.last_refusal() == RefusalCode::kUnarmed);
  }
}

// --- after a start -------------------------------------------------------------------------------

TEST(a_program_that_drove_before_a_start_does_not_drive_after_it) {
  for (const bool keeps_memory : {false, true}) {
    DrivingRobot first;
    CHECK(first.driven());
    RobotBench second;
    if (keeps_memory) second.survive_reset(first);
    second.connect();
    for (int i = 0; i < 100; ++i) {
      CHECK(refusal_of_drive(second) == RefusalCode::kUnarmed);
    }
    second.drive(0.0f, 0.0f);
    second.drive(0.2f, 0.2f);
    CHECK(second.driven());
  }
}

/// A library takes a while to find the chip again. This does not count as the program's pause.
TEST(the_time_before_a_session_is_no_gap) {
  RobotBench bench;
  bench.start();
  bench.run(3000);
  bench.greet();
  CHECK(refusal_of_drive(bench) == RefusalCode::kUnarmed);
}

TEST(a_stop_and_a_deadline_do_not_disarm) {
  DrivingRobot bench;
  bench.send(bench.stop());
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
  bench.run(400);
  CHECK(bench.state() == SupervisorState::kTimedOut);
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(a_cleared_fault_disarms_as_well) {
  DrivingRobot bench;
  bench.step(50'000);
  CHECK(bench.clear_fault() == RefusalCode::kNone);
  CHECK(refusal_of_drive(bench) == RefusalCode::kUnarmed);
}

// --- a write to flash and a setpoint in one step -------------------------------------------------

TEST(a_step_that_a_write_to_flash_delays_is_no_overrun) {
  OpenRobot bench;
  bench.send(ParameterSave{bench.session_id(), ++bench.request_id, 0});
  bench.drive(0.1f, 0.1f, 1);
  CHECK(bench.state() == SupervisorState::kDriving);
  bench.step(100'000);
  CHECK(bench.device.faults() == 0);
  bench.step(100'000);
  CHECK(bench.device.faults() == fault::kControlOverrun);
}
