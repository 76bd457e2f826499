// What the sensors forbid, at the robot's pins.
#include <cmath>

#include "check.hpp"
#include "sensor_bench.hpp"
#include "twin_store.hpp"

using namespace wheelwire;
using test::battery;
using test::bumper;
using test::list_of;
using test::RobotBench;
using test::SensorBench;

namespace {

const PeripheralList kBumpers = list_of({bumper(Place::kFrontLeft), bumper(Place::kRear, 39)});
const PeripheralList kCliff =
    list_of({Peripheral{.kind = PeripheralKind::kCliff, .place = Place::kFront, .pin_a = 36}});
const PeripheralList kGuard = list_of({battery(7000, 6800, 6400)});
constexpr Peripheral kIna219 = {.kind = PeripheralKind::kPower,
                                .chip = SensorChip::kIna219,
                                .pin_a = 16,
                                .pin_b = 17,
                                .value_a = 1000};

constexpr Peripheral kMpu6050 = {.kind = PeripheralKind::kImu,
                                 .chip = SensorChip::kMpu6050,
                                 .pin_a = 16,
                                 .pin_b = 17,
                                 .forward = Axis::kY,
                                 .up = Axis::kZ};

bool forward(const SensorBench& bench) { return bench.left.duty() > 0 || bench.right.duty() > 0; }

}  // namespace

// --- bumpers -------------------------------------------------------------------------------------

TEST(a_bumper_removes_the_drive_in_the_step_that_reads_it) {
  for (const size_t channel : {0u, 1u}) {
    SensorBench bench(kBumpers);
    bench.open();
    const float speed = channel == 0 ? 0.2f : -0.2f;
    bench.drive_on(speed, speed, 30);
    CHECK(bench.driven());
    bench.set_level(channel, true);
    bench.step();
    CHECK(!bench.driven());
    CHECK(bench.state() == SupervisorState::kDriving && bench.device.faults() == 0);
    bench.drive_on(speed, speed, 300);
    CHECK(!bench.driven());
    CHECK(bench.left.shortest_pause_us >= RobotBench::kPeriodUs);
  }
}

TEST(a_bumper_stops_an_open_loop_too) {
  SensorBench bench(kBumpers);
  bench.open();
  bench.send(bench.duty(20'000, 20'000));
  bench.run(100);
  CHECK(bench.left.duty() > 10'000);
  bench.set_level(0, true);
  bench.step();
  CHECK(!bench.driven());
  bench.send(bench.duty(20'000, 20'000));
  bench.run(20);
  CHECK(!bench.driven());
  bench.send(bench.duty(-20'000, -20'000));
  bench.run(20);
  CHECK(bench.left.duty() < 0 && bench.right.duty() < 0);
}

TEST(the_robot_backs_out_and_is_free_after_a_while) {
  SensorBench bench(kBumpers);
  bench.open();
  bench.set_level(0, true);
  bench.step();
  bench.drive_on(0.1f, 0.1f, 20);
  CHECK(!bench.driven());
  bench.drive_on(-0.1f, -0.1f, 20);
  CHECK(bench.left.duty() < 0 && bench.right.duty() < 0);
  bench.set_level(0, false);
  // A switch bounces: it is not free yet.
  bench.drive_on(0.1f, 0.1f, 45);
  CHECK(!forward(bench));
  bench.run(10);
  bench.drive_on(0.0f, 0.0f, 1);
  bench.drive_on(0.1f, 0.1f, 40);
  CHECK(forward(bench));
}

namespace {

/// It drove until its bumper opened, and the bumper is free again.
void bump(SensorBench& bench) {
  bench.open();
  bench.drive_on(0.2f, 0.2f, 100);
  bench.set_level(0, true);
  bench.drive_on(0.2f, 0.2f, 100);
  CHECK(!bench.driven());
  bench.set_level(0, false);
  bench.run(60);
}

RefusalCode last_refusal(const SensorBench& bench) {
  const auto refusals = bench.of<Refuse>();
  return refusals.empty() ? RefusalCode::kNone : refusals.back().code;
}

}  // namespace

TEST(a_bumper_that_is_free_again_does_not_restart_the_program) {
  SensorBench bench(kBumpers);
  bump(bench);
  // Neither the setpoint that is still valid nor the next ones.
  CHECK(bench.state() == SupervisorState::kDriving);
  for (int i = 0; i < 2000; ++i) {
    bench.drive_on(0.2f, 0.2f, 1);
    CHECK(!forward(bench));
  }
  CHECK(last_refusal(bench) == RefusalCode::kUnarmed);
  CHECK(bench.state() == SupervisorState::kTimedOut);
}

TEST(zero_a_pause_or_a_way_back_arms_after_a_bumper) {
  for (const int how : {0, 1, 2}) {
    SensorBench bench(kBumpers);
    bump(bench);
    if (how == 0) bench.drive_on(0.0f, 0.0f, 1);
    if (how == 1) bench.run(1000);
    if (how == 2) bench.drive_on(-0.1f, 0.0f, 1);
    bench.drive_on(0.2f, 0.2f, 200);
    CHECK(forward(bench) && last_refusal(bench) == RefusalCode::kNone);
  }
}

TEST(a_clear_after_a_bumper_needs_more_than_a_way_back) {
  SensorBench bench(kBumpers);
  bump(bench);
  bench.send(Estop{});
  bench.step();
  CHECK(bench.clear_estop() == RefusalCode::kNone);
  bench.drive_on(-0.1f, -0.1f, 20);
  CHECK(!bench.driven() && last_refusal(bench) == RefusalCode::kUnarmed);
}

/// Each wheel counts, however little the robot as a whole goes there.
TEST(no_wheel_turns_towards_a_bumper) {
  for (const size_t channel : {0u, 1u}) {
    const float way = channel == 0 ? 1.0f : -1.0f;
    const float wheels[][2] = {{-0.3001f, 0.3f}, {0.3f, -0.3001f}, {-0.3f, 0.05f}, {0.0f, 0.1f}};
    for (const auto& [left, right] : wheels) {
      SensorBench bench(kBumpers);
      bench.open();
      bench.set_level(channel, true);
      bench.step();
      bench.drive_on(way * left, way * right, 300);
      CHECK(!bench.driven() && bench.state() == SupervisorState::kDriving);
    }
    SensorBench bench(kBumpers);
    bench.open();
    bench.set_level(channel, true);
    bench.step();
    bench.drive_on(0.0f, way * -0.2f, 100);
    CHECK((channel == 0 ? bench.right.duty() < 0 : bench.right.duty() > 0) &&
          bench.left.duty() == 0);
  }
}

TEST(a_low_battery_slows_the_setpoint_that_is_obeyed_already) {
  SensorBench bench(kGuard);
  bench.open();
  const float top = bench.device.parameter(ParameterId::kMaxVelocityMps);
  CHECK(bench.set(ParameterId::kTtlMaxS, 5.0f) == RefusalCode::kNone);
  bench.send(bench.velocity(top, top, 5'000'000));
  bench.run(1);
  bench.battery.measured_mv = 6700;
  const auto fastest_mps = [&] { return to_mps(bench.device.commanded().left); };
  // The wheels follow.
  double rest = 0.0;
  const auto run = [&](int steps) {
    for (int i = 0; i < steps; ++i) {
      rest += fastest_mps() * 1e-3 / 0.000576;
      const int ticks = static_cast<int>(rest);
      rest -= ticks;
      bench.turn(ticks, ticks);
      bench.step();
    }
  };
  run(1900);
  CHECK(fastest_mps() > 0.99f * top);
  run(1000);
  CHECK(bench.state() == SupervisorState::kDriving && fastest_mps() < 0.51f * top);
}

TEST(turning_on_the_spot_needs_both_bumpers_free) {
  SensorBench bench(kBumpers);
  bench.open();
  for (const size_t channel : {0u, 1u}) {
    bench.set_level(channel, true);
    bench.step();
    for (const float speed : {0.1f, -0.1f}) {
      bench.drive_on(speed, -speed, 20);
      CHECK(!bench.driven());
    }
    bench.set_level(channel, false);
    bench.run(100);
  }
  bench.drive_on(0.0f, 0.0f, 1);
  bench.drive_on(0.1f, -0.1f, 20);
  CHECK(bench.left.duty() > 0 && bench.right.duty() < 0);
}

TEST(with_both_bumpers_open_nothing_drives) {
  SensorBench bench(kBumpers);
  bench.open();
  bench.set_level(0, true);
  bench.set_level(1, true);
  bench.step();
  for (const float speed : {0.2f, -0.2f}) {
    bench.drive_on(speed, speed, 20);
    CHECK(!bench.driven());
  }
}

/// The wheels still roll forward when the program begins to back out: they are not driven at that
/// speed first.
TEST(a_reversal_at_a_bumper_never_drives_forward) {
  SensorBench bench(kBumpers);
  bench.open();
  for (int i = 0; i < 200; ++i) {
    bench.turn(3, 3);
    bench.drive_on(0.3f, 0.3f, 1);
  }
  bench.set_level(0, true);
  for (int i = 0; i < 60; ++i) {
    bench.turn(2, 2);
    bench.drive_on(-0.2f, -0.2f, 1);
    CHECK(!forward(bench));
    const WheelPair commanded = bench.device.commanded();
    CHECK(commanded.left + commanded.right <= 0);
  }
  CHECK(bench.left.duty() < 0);
}

/// The setpoint is allowed already, but the slew limit still has the wheels going forward.
TEST(a_bumper_during_a_reversal_stops_the_slewing) {
  SensorBench bench(kBumpers);
  bench.open();
  bench.drive_on(0.4f, 0.4f, 400);
  bench.drive_on(-0.4f, -0.4f, 5);
  CHECK(bench.device.commanded().left > 0);
  bench.set_level(0, true);
  bench.drive_on(-0.4f, -0.4f, 1);
  CHECK(!bench.driven());
  bench.drive_on(-0.4f, -0.4f, 10);
  CHECK(bench.left.duty() < 0 && bench.device.commanded().left < 0);
}

/// Wheels that a hand holds while the setpoint reverses: the correction of the following error
/// still commands a speed forward when the setpoint is slewed backward already.
TEST(a_bumper_ends_a_correction_that_still_goes_forward) {
  for (int reversed_for = 1; reversed_for < 200; ++reversed_for) {
    SensorBench bench(kBumpers);
    bench.open();
    for (int i = 0; i < 120; ++i) {
      bench.send(bench.velocity(0.2f, 0.2f));
      bench.turn(i % 4 == 0, i % 4 == 0);
      bench.step();
    }
    for (int i = 0; i <= reversed_for; ++i) {
      bench.send(bench.velocity(-0.2f, -0.2f));
      if (i == reversed_for) bench.set_level(0, true);
      bench.step();
    }
    const WheelPair commanded = bench.device.commanded();
    CHECK(commanded.left + commanded.right <= 0);
  }
}

TEST(a_bumper_whose_wire_is_broken_at_the_start_forbids_driving_from_the_first_setpoint) {
  SensorBench bench(kBumpers);
  bench.set_level(0, true);
  bench.open();
  for (int i = 0; i < 50; ++i) {
    bench.drive_on(0.2f, 0.2f, 1);
    CHECK(!bench.driven());
  }
}

TEST(the_deadline_ends_driving_at_a_bumper_as_anywhere) {
  SensorBench bench(kBumpers);
  bench.open();
  bench.drive_on(0.2f, 0.2f, 10);
  bench.set_level(0, true);
  bench.run(400);
  CHECK(bench.state() == SupervisorState::kTimedOut);
}

// --- what stops ----------------------------------------------------------------------------------

TEST(a_cliff_is_a_fault_that_lasts_as_long_as_it_does) {
  SensorBench bench(kCliff);
  bench.open();
  bench.drive_on(0.2f, 0.2f, 20);
  CHECK(bench.driven());
  bench.set_level(0, true);
  bench.step();
  CHECK(!bench.driven() && bench.state() == SupervisorState::kFault);
  CHECK(bench.device.faults() == fault::kExternal);
  CHECK(bench.clear_fault() == RefusalCode::kCausePresent);
  bench.set_level(0, false);
  bench.run(60);
  CHECK(bench.clear_fault() == RefusalCode::kNone);
  CHECK(bench.state() == SupervisorState::kIdle);
}

TEST(a_robot_that_is_lifted_is_in_no_fault_until_it_is_to_drive) {
  SensorBench bench(kCliff);
  bench.open();
  bench.set_level(0, true);
  bench.run(20);
  CHECK(bench.state() == SupervisorState::kIdle);
  bench.received.clear();
  bench.send(bench.velocity(0.0f, 0.0f));
  bench.run(20);
  CHECK(bench.of<Refuse>().back().code == RefusalCode::kFault);
  CHECK(bench.state() == SupervisorState::kIdle && bench.device.faults() == 0);
  bench.received.clear();
  bench.send(bench.velocity(0.1f, 0.1f));
  bench.step();
  CHECK(bench.state() == SupervisorState::kFault && !bench.driven());
  CHECK(bench.of<Refuse>().back().code == RefusalCode::kFault);
}

TEST(a_power_stage_that_trips_is_a_fault) {
  SensorBench bench(list_of({Peripheral{
      .kind = PeripheralKind::kStageFault, .flags = peripheralflag::kTriggeredLow, .pin_a = 36}}));
  bench.set_level(0, true);
  bench.open();
  bench.drive_on(0.2f, 0.2f, 20);
  CHECK(bench.driven());
  bench.set_level(0, false);
  bench.step();
  CHECK(!bench.driven() && bench.device.faults() == fault::kExternal);
}

// --- the battery ---------------------------------------------------------------------------------

TEST(a_battery_limits_and_then_stops) {
  SensorBench bench(kGuard);
  bench.battery.measured_mv = 7400;
  bench.open();
  const float top = bench.device.parameter(ParameterId::kMaxVelocityMps);
  const auto settled = [&] {
    bench.drive_on(top, top, 2500);
    return to_mps(bench.device.commanded().left);
  };
  CHECK(settled() > 0.99f * top);
  bench.battery.measured_mv = 6900;
  CHECK(settled() > 0.99f * top);
  bench.battery.measured_mv = 6700;
  const float limited = settled();
  CHECK(limited > 0.49f * top && limited < 0.51f * top);
  bench.battery.measured_mv = 6300;
  bench.drive_on(top, top, 2500);
  CHECK(bench.device.faults() == fault::kExternal && !bench.driven());
  // Without its load the voltage rises by itself: it stays.
  bench.battery.measured_mv = 7100;
  bench.run(15'000);
  CHECK(bench.clear_fault() == RefusalCode::kCausePresent);
  bench.battery.measured_mv = 7400;
  bench.run(11'000);
  CHECK(bench.clear_fault() == RefusalCode::kNone);
}

TEST(a_sag_under_load_is_no_empty_battery) {
  SensorBench bench(kGuard);
  bench.open();
  for (int i = 0; i < 10; ++i) {
    bench.battery.measured_mv = 6000;
    bench.drive_on(0.2f, 0.2f, 1900);
    bench.battery.measured_mv = 7400;
    bench.drive_on(0.2f, 0.2f, 260);
    CHECK(bench.device.reflexes() == 0);
  }
}

TEST(a_battery_that_recovers_whenever_the_robot_stops_is_empty_all_the_same) {
  // Nine tenths of the time below the lowest level, in drives that are shorter than a sag.
  SensorBench bench(kGuard);
  bench.open();
  int drives = 0;
  for (; drives < 40 && bench.device.faults() == 0; ++drives) {
    bench.battery.measured_mv = 6000;
    bench.drive_on(0.2f, 0.2f, 1800);
    if (bench.device.faults() != 0) break;
    bench.send(bench.stop());
    bench.battery.measured_mv = 7400;
    bench.run(200);
  }
  CHECK(bench.device.faults() == fault::kExternal && drives == 1);
}

TEST(a_start_that_sags_again_and_again_is_no_empty_battery) {
  SensorBench bench(kGuard);
  bench.open();
  for (int i = 0; i < 60; ++i) {
    bench.battery.measured_mv = 6000;
    bench.drive_on(0.2f, 0.2f, 300);
    bench.battery.measured_mv = 7400;
    bench.drive_on(0.2f, 0.2f, 300);
    bench.send(bench.stop());
    bench.run(50);
  }
  CHECK(bench.device.faults() == 0 && bench.device.reflexes() == 0);
}

TEST(a_level_falls_by_the_time_below_its_own_bound) {
  SensorBench bench(kGuard);
  bench.open();
  const auto drive_at = [&](uint16_t millivolts, int steps) {
    bench.battery.measured_mv = millivolts;
    bench.drive_on(0.2f, 0.2f, steps);
  };
  // A dip amid a sag that stays above the lower bounds.
  drive_at(6950, 1940);
  drive_at(6300, 100);
  CHECK(bench.driven() && bench.device.reflexes() == 0);
  drive_at(6950, 5000);
  CHECK(bench.device.reflexes() == 0);
  drive_at(6300, 1990);
  CHECK(bench.driven() && bench.device.faults() == 0);
  // Deep enough for LIMIT all the time, and for STOP with an interruption, in which little leaks.
  drive_at(6700, 20);
  CHECK(bench.device.reflexes() == reflex::kLimit);
  drive_at(6300, 10);
  CHECK(bench.driven());
  drive_at(6300, 10);
  CHECK(!bench.driven() && bench.device.faults() == fault::kExternal);
}

TEST(a_voltage_that_trembles_around_one_level_rises_above_a_lower_one) {
  SensorBench bench(kGuard);
  bench.battery.measured_mv = 6700;
  bench.open();
  CHECK(bench.device.reflexes() == reflex::kLimit);
  for (int i = 0; i < 22; ++i) {
    CHECK(bench.device.reflexes() == reflex::kLimit);
    bench.battery.measured_mv = i % 2 == 0 ? 7200 : 7260;  // A 32nd above WARN is 7226 mV.
    bench.run(i == 21 ? 40 : 476);
  }
  CHECK(bench.device.reflexes() == 0);
}

TEST(silence_neither_charges_nor_empties_a_battery) {
  SensorBench bench(kGuard);
  bench.open();
  bench.battery.measured_mv = 6300;
  bench.drive_on(0.2f, 0.2f, 2100);
  CHECK(bench.device.faults() == fault::kExternal);
  const auto measure = [&](uint16_t millivolts, int milliseconds) {
    bench.battery.measured_mv = millivolts;
    bench.run(milliseconds);
  };
  measure(7600, 1000);
  measure(0, 9200);
  measure(7600, 9900);
  CHECK(bench.clear_fault() == RefusalCode::kCausePresent);
  measure(7600, 200);
  CHECK(bench.clear_fault() == RefusalCode::kNone);
  // What it fell before counts on, and silence adds nothing.
  measure(6300, 1500);
  measure(0, 700);
  measure(6300, 450);
  CHECK((bench.device.reflexes() & reflex::kStop) == 0);
  measure(6300, 100);
  CHECK((bench.device.reflexes() & reflex::kStop) != 0);
}

namespace {

/// A robot whose battery was at STOP, and has recovered without its load.
void drive_empty(SensorBench& bench) {
  bench.open();
  bench.battery.measured_mv = 6300;
  bench.drive_on(0.2f, 0.2f, 2100);
  CHECK(bench.device.faults() == fault::kExternal && !bench.driven());
  bench.battery.measured_mv = 6900;
  bench.run(100);
  CHECK(bench.clear_fault() == RefusalCode::kCausePresent);
}

/// A reset of the processor; the battery has 6.9 V.
void survive(const SensorBench& before, SensorBench& after) {
  after.latches.record = before.latches.record;
  after.battery.measured_mv = 6900;
}

}  // namespace

TEST(a_reset_charges_no_battery) {
  SensorBench first(kGuard);
  drive_empty(first);
  // Neither does a reset on a board whose list has no levels, such as a list on trial.
  SensorBench second(kBumpers);
  survive(first, second);
  second.open();
  CHECK(second.clear_fault() == RefusalCode::kNone);
  second.run(20);
  SensorBench third(kGuard);
  survive(second, third);
  third.open();
  third.drive_on(0.2f, 0.2f, 50);
  CHECK(!third.driven() && third.device.faults() == fault::kExternal);
  third.run(20'000);
  CHECK(third.clear_fault() == RefusalCode::kCausePresent);
  third.battery.measured_mv = 7400;
  third.run(11'000);
  CHECK(third.clear_fault() == RefusalCode::kNone);
  SensorBench fourth(kGuard);
  survive(third, fourth);
  fourth.open();
  fourth.send(fourth.velocity(0, 0));
  fourth.drive_on(0.2f, 0.2f, 50);
  CHECK(fourth.driven());
}

TEST(after_a_power_cut_the_first_voltage_decides) {
  SensorBench first(kGuard);
  drive_empty(first);
  SensorBench second(kGuard);
  second.latch_store.block = first.latch_store.block;
  second.battery.measured_mv = 6900;
  second.open();
  second.drive_on(0.2f, 0.2f, 50);
  CHECK(second.driven());
}

TEST(a_fault_is_not_cleared_before_its_cause_can_be_read) {
  SensorBench first(kGuard);
  first.open();
  first.battery.measured_mv = 0;
  first.drive_on(0.2f, 0.2f, 200);
  CHECK(first.device.faults() == fault::kExternal);
  SensorBench second(kGuard);
  survive(first, second);
  second.battery.measured_mv = 0;
  second.open();
  for (int i = 0; i < 3; ++i) {
    CHECK(second.clear_fault() == RefusalCode::kCausePresent);
    second.run(500);
  }
  CHECK(second.device.faults() == fault::kExternal);
}

TEST(an_empty_battery_drives_not_even_at_first) {
  SensorBench bench(kGuard);
  bench.battery.measured_mv = 6000;
  bench.open();
  for (int i = 0; i < 50; ++i) {
    bench.drive_on(0.2f, 0.2f, 1);
    CHECK(!bench.driven());
  }
}

TEST(a_battery_that_was_not_read_yet_refuses_setpoints_and_then_stops) {
  SensorBench bench(kGuard);
  bench.battery.measured_mv = 0;
  bench.open();
  bench.send(bench.velocity(0.2f, 0.2f));
  bench.step();
  CHECK(bench.of<Refuse>().back().code == RefusalCode::kBooting);
  CHECK(bench.state() == SupervisorState::kIdle);
  bench.run(1000);
  bench.send(bench.velocity(0.2f, 0.2f));
  bench.step();
  CHECK(bench.of<Refuse>().back().code == RefusalCode::kFault);
  CHECK(bench.device.faults() == fault::kExternal);
}

TEST(a_divider_whose_wire_breaks_stops_the_robot) {
  SensorBench bench(kGuard);
  bench.open();
  bench.drive_on(0.2f, 0.2f, 20);
  bench.battery.measured_mv = 0;
  bench.drive_on(0.2f, 0.2f, 90);
  CHECK(bench.driven());  // One reading of 0 may be noise.
  bench.drive_on(0.2f, 0.2f, 15);
  CHECK(!bench.driven() && bench.device.faults() == fault::kExternal);
}

TEST(a_battery_that_is_only_measured_stops_nothing) {
  SensorBench bench(list_of({battery(0, 0, 0)}));
  bench.battery.measured_mv = 0;
  bench.open();
  bench.drive_on(0.2f, 0.2f, 1500);
  CHECK(bench.device.reflexes() == 0 && bench.state() == SupervisorState::kDriving);
}

TEST(a_power_sensor_that_falls_silent_stops_the_robot) {
  SensorBench bench(list_of({battery(7000, 6800, 6400), kIna219}), false);
  const auto measure = [&](uint16_t millivolts) {
    bench.sensors.power =
        PowerReading{.state = SensorState::kOk, .t_us = bench.now_us, .voltage_mv = millivolts};
  };
  measure(7400);
  bench.open();
  for (int i = 0; i < 10; ++i) {
    measure(7400);
    bench.drive_on(0.2f, 0.2f, 100);
  }
  CHECK(bench.driven() && bench.device.faults() == 0);
  measure(7400);
  bench.drive_on(0.2f, 0.2f, 195);
  CHECK(bench.driven());
  bench.drive_on(0.2f, 0.2f, 10);
  CHECK(!bench.driven() && bench.device.faults() == fault::kExternal);
}

TEST(a_power_sensor_guards_the_battery_also_beside_a_divider) {
  SensorBench bench(list_of({battery(7000, 6800, 6400), kIna219}));
  bench.battery.measured_mv = 7600;
  const auto measure = [&](uint16_t millivolts) {
    bench.sensors.power =
        PowerReading{.state = SensorState::kOk, .t_us = bench.now_us, .voltage_mv = millivolts};
  };
  measure(5800);
  bench.open();
  measure(5800);
  bench.drive_on(0.2f, 0.2f, 20);
  CHECK(!bench.driven() && bench.device.faults() == fault::kExternal);
}

TEST(a_battery_that_nothing_measures_is_missing_after_a_second) {
  SensorBench bench(kGuard, false);
  bench.open();
  bench.send(bench.velocity(0.2f, 0.2f));
  bench.step();
  CHECK(bench.of<Refuse>().back().code == RefusalCode::kBooting);
  bench.run(1000);
  bench.send(bench.velocity(0.2f, 0.2f));
  bench.step();
  CHECK(bench.of<Refuse>().back().code == RefusalCode::kFault);
  CHECK(bench.device.faults() == fault::kExternal && !bench.driven());
}

TEST(charge_is_counted_while_the_current_is_measured) {
  struct Nobody final : SensorObserver {
    void on_sensor_event(SensorEventCode, size_t, uint16_t, uint64_t) override {}
    void on_reading(size_t, const ImuReading&, uint16_t) override {}
    void on_reading(size_t, const RangeReading&, uint16_t) override {}
  } nobody;
  const PeripheralList list = list_of({kIna219});
  test::BenchSensors sensors;
  SensorHub hub(nobody);
  hub.start(sensors, list);
  const auto measure = [&](uint64_t t_us, int32_t milliamperes) {
    sensors.power =
        PowerReading{.state = SensorState::kOk, .t_us = t_us, .current_ma = milliamperes};
    hub.update(0, t_us + 500);
    return hub.used_mah();
  };
  constexpr uint64_t kHourUs = 3'600'000'000;
  constexpr uint64_t kPeriodUs = SensorHub::kPowerPeriodUs;
  // The sensors' task was there before the control task's first step.
  hub.update(0, kPeriodUs);
  CHECK(measure(10, 36'000) == 0.0f);
  CHECK(std::abs(measure(10 + kPeriodUs, 36'000) - 1.0f) < 1e-5f);
  // It flows back while a motor brakes.
  CHECK(std::abs(measure(10 + 2 * kPeriodUs, -36'000)) < 1e-5f);
  // The charge drawn in an hour of steps without a reading is unknown.
  hub.update(0, kHourUs - 1000);
  hub.update(0, kHourUs);
  CHECK(hub.state(0) == SensorState::kMissed);
  CHECK(std::abs(measure(kHourUs, 36'000)) < 1e-5f);
  // A day at 10 mA.
  for (uint64_t t_us = kHourUs; t_us < 25 * kHourUs; t_us += kPeriodUs)
    measure(t_us + kPeriodUs, 10);
  CHECK(std::abs(hub.used_mah() - 240.0f) < 0.1f);
}

// --- what the host is sent -----------------------------------------------------------------------

TEST(a_host_that_did_not_ask_is_sent_nothing) {
  SensorBench bench(kBumpers);
  bench.open();
  bench.set_level(0, true);
  bench.run(2000);
  CHECK(bench.of<SensorEvent>().empty() && bench.of<Inputs>().empty());
  CHECK(bench.of<SensorInfo>().empty());
}

TEST(a_host_that_asks_is_sent_channels_changes_and_readings) {
  SensorBench bench(list_of({kMpu6050, bumper(Place::kFront)}));
  bench.open();
  CHECK(bench.refusal(SensorStream{.rate_hz = 200}) == RefusalCode::kNone);
  bench.run(5);
  CHECK(bench.of<SensorInfo>().size() == 2 && bench.of<Inputs>().size() == 1);
  for (const SensorInfo& info : bench.of<SensorInfo>()) {
    CHECK(info.channel_count == 2);
    if (info.channel == 0) CHECK(info.rate_hz == 200 && info.gyro_scale > 0);
  }
  for (int i = 0; i < 10; ++i) {
    bench.sensors.imu = ImuReading{.state = SensorState::kOk,
                                   .t_us = bench.now_us - 300,
                                   .bound_us = 50,
                                   .gyro = {static_cast<int16_t>(i), 2, 3}};
    bench.run(5);
  }
  const auto readings = bench.of<Imu>();
  CHECK(readings.size() == 10);
  for (size_t i = 0; i < readings.size(); ++i)
    CHECK(readings[i].gyro_x == static_cast<int16_t>(i) && readings[i].bound_us == 50);
  bench.set_level(1, true);
  bench.run(30);
  CHECK(bench.of<Inputs>().back().triggered == 2);
  CHECK(bench.of<Inputs>().back().edges_1 == 1);
  CHECK(bench.of<Inputs>().back().reflexes == reflex::kNoForward);
  bool triggered = false;
  for (const SensorEvent& event : bench.of<SensorEvent>())
    triggered = triggered || (event.code == SensorEventCode::kTriggered && event.channel == 1);
  CHECK(triggered);
}

TEST(a_reading_is_never_sent_again_and_its_absence_is_named) {
  SensorBench bench(list_of({kMpu6050}));
  bench.open();
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.sensors.imu = ImuReading{.state = SensorState::kOk, .t_us = bench.now_us};
  bench.run(11);
  CHECK(bench.of<Imu>().size() == 1);
  bench.received.clear();
  bench.run(2);
  std::vector<uint16_t> states;
  for (const SensorEvent& event : bench.of<SensorEvent>())
    if (event.code == SensorEventCode::kState) states.push_back(event.value);
  CHECK(states == std::vector{static_cast<uint16_t>(SensorState::kMissed)});
  bench.run(30);
  CHECK(bench.of<Imu>().empty());
  CHECK(!bench.of<Inputs>().empty() && bench.of<Inputs>().back().stale == 1);
}

TEST(inputs_that_do_not_change_are_sent_each_second_beside_an_imu) {
  SensorBench bench(list_of({kMpu6050, bumper(Place::kFront)}));
  bench.open();
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.run(100);
  bench.received.clear();
  for (int i = 0; i < 400; ++i) {
    bench.sensors.imu = ImuReading{.state = SensorState::kOk, .t_us = bench.now_us};
    bench.run(5);
  }
  CHECK(bench.of<Imu>().size() > 390);
  CHECK(bench.of<Inputs>().size() == 2);
  CHECK(bench.of<Inputs>().back().edges_0 == 0);
}

TEST(states_go_before_sensors_on_a_slow_line) {
  SensorBench bench(list_of({kMpu6050}));
  bench.line.rate = 11'520;
  bench.open();
  CHECK(bench.refusal(SetStreamRate{.rate_hz = 150}) == RefusalCode::kNone);
  bench.received.clear();
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.run(3);
  const auto events = bench.of<SensorEvent>();
  CHECK(!events.empty() && events[0].code == SensorEventCode::kReduced);
  const uint16_t rate_hz = events[0].value;
  CHECK(rate_hz > 0 && rate_hz < 100);
  CHECK(bench.of<SensorInfo>()[0].rate_hz == rate_hz);
  const double bytes = 150.0 * frame_size(WheelState::kSize) + rate_hz * frame_size(Imu::kSize);
  CHECK(bytes <= 0.8 * 11'520 && bytes > 0.75 * 11'520);
}

TEST(an_imu_that_gets_nothing_of_the_line_is_reported) {
  SensorBench bench(list_of({kMpu6050}));
  bench.line.rate = 11'520;
  bench.open();
  CHECK(bench.refusal(SetStreamRate{.rate_hz = 188}) == RefusalCode::kNone);
  bench.received.clear();
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.run(3);
  const auto events = bench.of<SensorEvent>();
  CHECK(!events.empty() && events[0].code == SensorEventCode::kReduced && events[0].value == 0);
  CHECK(bench.of<SensorInfo>()[0].rate_hz == 0);
}

namespace {

const Peripheral kRange{.kind = PeripheralKind::kRange,
                        .chip = SensorChip::kHcSr04,
                        .place = Place::kFront,
                        .pin_a = 21,
                        .pin_b = 34};
const PeripheralList kAnalog = list_of(
    {Peripheral{.kind = PeripheralKind::kAnalog, .pin_a = 35, .value_a = 4000, .value_b = 2}});

/// What it was sent of the input, after a reading.
std::vector<uint16_t> inputs_after(SensorBench& bench, uint16_t pin_mv, int milliseconds) {
  bench.sensors.analog = AnalogReading{.pin_mv = pin_mv};
  bench.received.clear();
  bench.run(milliseconds);
  std::vector<uint16_t> found;
  for (const Inputs& inputs : bench.of<Inputs>()) found.push_back(inputs.analog_2_mv);
  return found;
}

}  // namespace

TEST(the_bias_of_an_imu_is_sent_as_its_entry_has_it) {
  Peripheral imu = kMpu6050;
  imu.value_a = 3;
  imu.value_b = 0xffff;
  imu.value_c = 0x8000;
  SensorBench bench(list_of({imu}));
  bench.open();
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.run(2);
  const SensorInfo info = bench.of<SensorInfo>().back();
  CHECK(info.bias_x == 3 && info.bias_y == -1 && info.bias_z == INT16_MIN);
}

TEST(a_measured_range_is_sent_once_and_only_if_it_can_be_used) {
  SensorBench bench(list_of({kRange}));
  bench.sensors.range = RangeReading{.state = SensorState::kOk, .t_us = 1};
  bench.open();
  CHECK(bench.of<Range>().empty());  // No host has asked.
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.run(2);
  CHECK(bench.of<SensorInfo>().back().rate_hz == 16);
  const uint64_t t_us = bench.now_us;
  bench.sensors.range = RangeReading{.state = SensorState::kOk,
                                     .t_us = t_us,
                                     .bound_us = 250,
                                     .distance_mm = 812,
                                     .quality = RangeQuality::kGood};
  bench.run(100);
  CHECK(bench.of<Range>().size() == 1);
  const Range found = bench.of<Range>()[0];
  CHECK(found.t_us == t_us && found.bound_us == 250 && found.distance_mm == 812);
  CHECK(found.channel == 0 && found.quality == RangeQuality::kGood);
  bench.sensors.range = RangeReading{.state = SensorState::kAbsent, .t_us = bench.now_us};
  bench.run(100);
  CHECK(bench.of<Range>().size() == 1);
  CHECK(bench.of<SensorEvent>().back().value == static_cast<uint16_t>(SensorState::kAbsent));
}

TEST(ranges_go_before_an_imu_on_a_slow_line) {
  SensorBench bench(list_of({kRange, kMpu6050}));
  bench.line.rate = 11'520;
  bench.open();
  CHECK(bench.refusal(SetStreamRate{.rate_hz = 100}) == RefusalCode::kNone);
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.run(3);
  const uint16_t rate_hz = bench.of<SensorInfo>()[0].rate_hz;
  const double others = 100.0 * frame_size(WheelState::kSize) + 17 * frame_size(Range::kSize);
  const double bytes = others + rate_hz * frame_size(Imu::kSize);
  CHECK(rate_hz > 0 && rate_hz < 200);
  CHECK(bytes <= 0.8 * 11'520 && bytes > 0.75 * 11'520);
}

TEST(an_analogue_input_is_sent_when_it_has_moved_and_each_second) {
  SensorBench bench(kAnalog);
  bench.sensors.analog = AnalogReading{.pin_mv = 500};
  bench.open();
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.run(30);
  CHECK(bench.of<Inputs>().back().analog_2_mv == 2000);
  CHECK(bench.of<Inputs>().back().stale == 0);
  CHECK(inputs_after(bench, 549, 100).empty());
  CHECK(inputs_after(bench, 550, 100) == std::vector<uint16_t>{2200});
  CHECK(inputs_after(bench, 501, 100).empty());
  CHECK(inputs_after(bench, 500, 100) == std::vector<uint16_t>{2000});
  CHECK(inputs_after(bench, 520, 100).empty());
  // What it trembles by is in the next one that is sent.
  std::vector<uint16_t> sent;
  for (int i = 0; i < 11; ++i)
    for (const uint16_t millivolts : inputs_after(bench, 521, 100)) sent.push_back(millivolts);
  CHECK(sent == std::vector<uint16_t>{2084});
  CHECK(inputs_after(bench, 20'000, 100) == std::vector<uint16_t>{UINT16_MAX});
}

TEST(an_analogue_input_that_nobody_reads_is_no_voltage) {
  SensorBench bench(kAnalog);
  bench.open();
  bench.refusal(SensorStream{.rate_hz = 200});
  bench.run(30);
  CHECK(bench.of<Inputs>().back().stale == 1);
  CHECK(inputs_after(bench, 0, 30) == std::vector<uint16_t>{0});
  CHECK(bench.of<Inputs>().back().stale == 0);
  CHECK(inputs_after(bench, 800, 199).back() == 3200);
  bench.received.clear();
  bench.run(25);
  CHECK(bench.of<SensorEvent>().size() == 1);
  CHECK(bench.of<SensorEvent>()[0].value == static_cast<uint16_t>(SensorState::kMissed));
  CHECK(bench.of<Inputs>().back().stale == 1 && bench.of<Inputs>().back().analog_2_mv == 0);
}

// --- rolling -------------------------------------------------------------------------------------

namespace {

/// The events of a robot that rolls at 0.576 m/s while its host drives on against a bumper.
int rolling_events(SensorBench& bench, float left_mps, float right_mps, int steps) {
  for (int i = 0; i < steps; ++i) {
    bench.send(bench.velocity(left_mps, right_mps));
    bench.turn(1, 1);
    bench.step();
  }
  int events = 0;
  for (const Event& event : bench.of<Event>()) {
    if (event.code != EventCode::kRolling) continue;
    ++events;
    CHECK(event.after == SupervisorState::kDriving);
    CHECK(event.speed_mps > 0.5f && event.speed_mps < 0.65f);
  }
  return events;
}

}  // namespace

TEST(a_robot_that_rolls_while_a_bumper_holds_it_is_reported) {
  SensorBench bench(kBumpers);
  bench.open();
  bench.set_level(0, true);
  CHECK(rolling_events(bench, 0.2f, 0.2f, 1500) == 1);
  CHECK(bench.state() == SupervisorState::kDriving && !forward(bench));
}

TEST(a_robot_that_a_bumper_lets_drive_back_does_not_roll) {
  SensorBench bench(kBumpers);
  bench.open();
  bench.set_level(0, true);
  bench.drive_on(-0.4f, -0.4f, 1500);
  CHECK(bench.driven());
  for (const Event& event : bench.of<Event>()) CHECK(event.code != EventCode::kRolling);
}
