// What survives a reset, and what ends it.
#include "latches.hpp"

#include "check.hpp"
#include "memory_store.hpp"
#include "robot_bench.hpp"

using namespace wheelwire;
using enum ParameterId;
using test::OpenRobot;
using test::RobotBench;

namespace {

/// A reset of the processor: what `before` had in memory and flash is there again.
void survive(const RobotBench& before, RobotBench& after) {
  after.latches.record = before.latches.record;
  after.latch_store.block = before.latch_store.block;
}

/// A power-on: only flash is left.
void survive_in_flash(const RobotBench& before, RobotBench& after) {
  after.latch_store.block = before.latch_store.block;
}

RefusalCode last_refusal(const RobotBench& bench) {
  const auto refusals = bench.of<Refuse>();
  return refusals.empty() ? RefusalCode::kNone : refusals.back().code;
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

TEST(an_estop_survives_a_reset_until_it_is_cleared) {
  RobotBench first;
  first.open().send(Estop{});
  first.step();
  RobotBench second;
  survive(first, second);
  second.open();
  CHECK(second.state() == SupervisorState::kEstopped);
  second.drive(0.2f, 0.2f);
  CHECK(!second.driven() && last_refusal(second) == RefusalCode::kEstopped);
  CHECK(second.clear_estop() == RefusalCode::kNone);
  RobotBench third;
  survive(second, third);
  third.open();
  CHECK(third.state() == SupervisorState::kIdle);
}

TEST(a_fault_survives_a_reset_with_its_flags_until_it_is_cleared) {
  RobotBench first;
  first.open().drive(0.2f, 0.2f);
  first.step(50'000);
  CHECK(first.device.faults() == fault::kControlOverrun);
  RobotBench second;
  survive(first, second);
  second.open();
  CHECK(second.state() == SupervisorState::kFault);
  CHECK(second.device.faults() == fault::kControlOverrun);
  CHECK(second.clear_fault() == RefusalCode::kNone);
  RobotBench third;
  survive(second, third);
  third.open();
  CHECK(third.state() == SupervisorState::kIdle && third.device.faults() == 0);
}

TEST(a_fault_below_an_estop_survives_a_reset_and_can_be_cleared_there) {
  RobotBench first;
  first.open().drive(0.2f, 0.2f);
  first.step(50'000);
  first.send(Estop{});
  first.step();
  RobotBench second;
  survive(first, second);
  second.open();
  CHECK(second.state() == SupervisorState::kEstopped);
  CHECK(second.device.faults() == fault::kControlOverrun);
  CHECK(second.clear_fault() == RefusalCode::kNone);
  RobotBench third;
  survive(second, third);
  third.open();
  CHECK(third.state() == SupervisorState::kEstopped && third.device.faults() == 0);
}

TEST(an_estop_survives_a_power_cut_once_the_wheels_stand) {
  RobotBench first;
  first.open().drive(0.2f, 0.2f);
  for (int i = 0; i < 50; ++i) {
    first.turn(1, 1);
    first.step();
  }
  first.send(Estop{});
  for (int i = 0; i < 20; ++i) {
    first.turn(1, 1);
    first.step();
    CHECK(first.latch_store.block.empty());  // A write to flash never meets a turning wheel.
  }
  first.run(3000);
  CHECK(!first.latch_store.block.empty());
  RobotBench second;
  survive_in_flash(first, second);
  second.open();
  CHECK(second.state() == SupervisorState::kEstopped);
  second.run(3000);
  CHECK(second.clear_estop() == RefusalCode::kNone);
  RobotBench third;
  survive_in_flash(second, third);
  third.open();
  CHECK(third.state() == SupervisorState::kIdle);
}

TEST(a_wheel_that_turns_back_is_not_at_rest) {
  RobotBench bench;
  bench.open().run(3000);
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
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f, 100);
  bench.send(Estop{});
  bench.run(1990);
  CHECK(bench.state() == SupervisorState::kEstopped && bench.latch_store.block.empty());
  bench.run(20);
  CHECK(!bench.latch_store.block.empty());
}

TEST(an_estop_that_chatters_wears_no_flash) {
  RobotBench bench;
  bench.open().run(3000);
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
TEST(an_estop_is_in_flash_although_the_robot_creeps_on_its_brake) {
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f);
  bench.send(Estop{});
  for (int ms = 0; ms < 15'000; ++ms) {
    if (ms % 4 == 0) bench.turn(1, 1);  // 0.144 m/s
    bench.step();
    if (ms < 1900) CHECK(bench.latch_store.block.empty());
  }
  CHECK(!bench.latch_store.block.empty());
}

TEST(an_estop_is_not_in_flash_while_the_robot_rolls_or_coasts) {
  for (const bool coasts : {false, true}) {
    OpenRobot bench;
    if (coasts) CHECK(bench.set(kEstopMode, 1) == RefusalCode::kNone);
    bench.drive(0.2f, 0.2f);
    bench.send(Estop{});
    for (int ms = 0; ms < 15'000; ++ms) {
      if (ms % (coasts ? 4 : 2) == 0) bench.turn(1, 1);  // 0.144 or 0.288 m/s
      bench.step();
    }
    CHECK(bench.latch_store.block.empty());
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

TEST(a_record_that_cannot_be_read_is_an_estop) {
  RobotBench damaged;
  damaged.latches.record = {1, 2, 3};
  damaged.open();
  CHECK(damaged.state() == SupervisorState::kEstopped);
  RobotBench flash;
  flash.latch_store.block = {1, 2, 3};
  flash.open();
  CHECK(flash.state() == SupervisorState::kEstopped);
  CHECK(flash.clear_estop() == RefusalCode::kNone);
  flash.run(3000);
  RobotBench next;
  survive_in_flash(flash, next);
  next.open();
  CHECK(next.state() == SupervisorState::kIdle);
}

TEST(a_contact_that_is_open_at_the_start_latches) {
  RobotBench bench;
  bench.contact.open = true;
  bench.start();
  CHECK(bench.state() == SupervisorState::kEstopped);
  CHECK(bench.latches.record.size() == Latches::kSize);
}

// --- after a clear -------------------------------------------------------------------------------

namespace {

/// E-stopped while a program drives, and cleared.
void clear_under_a_program(RobotBench& bench) {
  bench.open().drive(0.2f, 0.2f);
  bench.send(Estop{});
  bench.drive(0.2f, 0.2f);
  CHECK(bench.clear_estop() == RefusalCode::kNone);
}

}  // namespace

TEST(a_clear_does_not_restart_a_program_that_goes_on_sending) {
  RobotBench bench;
  clear_under_a_program(bench);
  for (int i = 0; i < 100; ++i) {
    bench.drive(0.2f, 0.2f);
    CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
  }
  CHECK(bench.state() == SupervisorState::kIdle);
}

TEST(a_zero_setpoint_arms) {
  RobotBench bench;
  clear_under_a_program(bench);
  bench.drive(0.0f, 0.0f);
  CHECK(bench.state() == SupervisorState::kDriving && !bench.driven());
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(a_zero_duty_arms_and_an_expired_zero_does_not) {
  RobotBench bench;
  clear_under_a_program(bench);
  bench.send(bench.velocity(0.0f, 0.0f, 0));
  bench.drive(0.2f, 0.2f);
  CHECK(last_refusal(bench) == RefusalCode::kUnarmed);
  bench.send(bench.duty(0, 0));
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(a_gap_arms_and_starts_at_the_latest_setpoint) {
  RobotBench bench;
  clear_under_a_program(bench);
  bench.run(900);
  bench.drive(0.2f, 0.2f, 1);
  CHECK(last_refusal(bench) == RefusalCode::kUnarmed);
  bench.run(998);
  bench.drive(0.2f, 0.2f, 1);
  CHECK(last_refusal(bench) == RefusalCode::kUnarmed);
  bench.run(999);
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(a_setpoint_counts_as_having_come_whatever_it_is_refused_for) {
  for (const int refused_for : {0, 1, 2, 3}) {
    RobotBench bench;
    clear_under_a_program(bench);
    if (refused_for == 0) bench.send(RobotBench::hello(RobotBench::kNonce + 1));
    const uint32_t session = bench.session_id() + (refused_for == 0 ? 1 : 0);
    for (int i = 0; i < 12; ++i) {
      SetWheelVelocity setpoint = bench.velocity(0.2f, 0.2f);
      setpoint.session_id = session;
      if (refused_for == 1) setpoint.left_mps = __builtin_nanf("");
      if (refused_for == 2) setpoint.session_id = 99;
      if (refused_for == 3) setpoint.expiry_us = 0;
      bench.send(setpoint);
      bench.run(50);
    }
    if (refused_for == 0) bench.send(Ping{session, 1, 0});
    SetWheelVelocity setpoint = bench.velocity(0.2f, 0.2f);
    setpoint.session_id = session;
    bench.send(setpoint);
    bench.run(5);
    CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
  }
}

TEST(neither_a_stop_nor_a_new_session_arms) {
  RobotBench bench;
  clear_under_a_program(bench);
  bench.send(bench.stop());
  bench.drive(0.2f, 0.2f);
  CHECK(last_refusal(bench) == RefusalCode::kUnarmed);
  bench.send(RobotBench::hello(RobotBench::kNonce + 1));
  bench.send(Ping{(RobotBench::kNonce + 1) ^ RobotBench::kBootId, 1, 0});
  SetWheelVelocity setpoint = bench.velocity(0.2f, 0.2f);
  setpoint.session_id = (RobotBench::kNonce + 1) ^ RobotBench::kBootId;
  bench.send(setpoint);
  bench.run(20);
  CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
}

TEST(a_clear_with_nothing_to_clear_disarms_nothing) {
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f);
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
      bench.send(Estop{});
      bench.step();
      CHECK(bench.clear_estop() == RefusalCode::kNone);
      for (int i = 0; i < 5; ++i) {
        bench.drive(0.2f, 0.2f, period_ms);
        CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
      }
    }
  }
}

TEST(a_longer_gap_counts_as_it_is) {
  OpenRobot bench;
  CHECK(bench.set(kRearmGapS, 2.0f) == RefusalCode::kNone);
  bench.send(Estop{});
  bench.step();
  CHECK(bench.clear_estop() == RefusalCode::kNone);
  bench.run(1990);
  bench.drive(0.2f, 0.2f, 1);
  CHECK(last_refusal(bench) == RefusalCode::kUnarmed);
}

TEST(turning_about_one_wheel_does_not_arm) {
  for (const float left_mps : {0.0f, 0.2f, -0.2f}) {
    RobotBench bench;
    clear_under_a_program(bench);
    bench.drive(left_mps, left_mps == 0.0f ? 0.2f : 0.0f);
    CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
    bench.send(bench.duty(left_mps == 0.0f ? int16_t{0} : int16_t{9000},
                          left_mps == 0.0f ? int16_t{9000} : int16_t{0}));
    bench.run(20);
    CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
  }
}

// --- after a start -------------------------------------------------------------------------------

TEST(a_program_that_drove_before_a_start_does_not_drive_after_it) {
  for (const bool keeps_memory : {false, true}) {
    RobotBench first;
    first.open().drive(0.2f, 0.2f);
    CHECK(first.driven());
    RobotBench second;
    if (keeps_memory) survive(first, second);
    second.connect();
    for (int i = 0; i < 100; ++i) {
      second.drive(0.2f, 0.2f);
      CHECK(!second.driven() && last_refusal(second) == RefusalCode::kUnarmed);
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
  bench.send(RobotBench::hello(RobotBench::kNonce));
  bench.send(Ping{bench.session_id(), ++bench.request_id, 0});
  bench.drive(0.2f, 0.2f);
  CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
}

TEST(a_stop_and_a_deadline_do_not_disarm) {
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f);
  bench.send(bench.stop());
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
  bench.run(400);
  CHECK(bench.state() == SupervisorState::kTimedOut);
  bench.drive(0.2f, 0.2f);
  CHECK(bench.driven());
}

TEST(a_cleared_fault_disarms_as_well) {
  RobotBench bench;
  bench.open().drive(0.2f, 0.2f);
  bench.step(50'000);
  CHECK(bench.clear_fault() == RefusalCode::kNone);
  bench.drive(0.2f, 0.2f);
  CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
}

// --- a write to flash and a setpoint in one step -------------------------------------------------

TEST(a_step_that_a_write_to_flash_delays_is_no_overrun) {
  OpenRobot bench;
  bench.send(ParameterSave{bench.session_id(), ++bench.request_id, 0});
  bench.send(bench.velocity(0.1f, 0.1f));
  bench.step();
  CHECK(bench.state() == SupervisorState::kDriving);
  bench.step(100'000);
  CHECK(bench.device.faults() == 0);
  bench.step(100'000);
  CHECK(bench.device.faults() == fault::kControlOverrun);
}
