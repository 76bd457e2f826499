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

/// A wheel whose encoder is dead has time to run down, too.
TEST(flash_is_not_written_soon_after_a_drive_nor_tried_at_every_step_if_it_fails) {
  OpenRobot bench;
  bench.latch_store.failing = true;
  bench.drive(0.2f, 0.2f, 100);
  bench.send(Estop{});
  bench.run(1990);
  CHECK(bench.state() == SupervisorState::kEstopped && bench.latch_store.saves == 0);
  bench.run(20);
  CHECK(bench.latch_store.saves == 1);
  bench.latch_store.failing = false;
  bench.run(1000);
  CHECK(bench.latch_store.block.empty());
  bench.run(10'000);
  CHECK(!bench.latch_store.block.empty());
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
