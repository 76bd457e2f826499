// What the sensors forbid, at the robot's pins.
#include <algorithm>
#include <cmath>

#include "sensor_bench.hpp"
#include "twin_store.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

const PeripheralList kBumpers = list_of({bumper(Place::kFrontLeft), bumper(Place::kRear, 39)});
const PeripheralList kGuard = list_of({battery(7000, 6800, 6400)});
bool forward(const SensorBench& bench) { return bench.left.duty() > 0 || bench.right.duty() > 0; }

struct Nobody final : HubRig {
  void poll() override {}
};

/// A voltage that lasts for some time, and the battery's level at its end.
struct Phase {
  uint16_t millivolts;
  int milliseconds;
  BatteryLevel level;
};
/// The phases follow each other so many times.
struct Course {
  int times;
  std::vector<Phase> phases;
};

/// What the power sensor measures now.
void measure(SensorBench& bench, uint16_t millivolts) {
  bench.sensors.power =
      PowerReading{.state = SensorState::kOk, .t_us = bench.now_us, .voltage_mv = millivolts};
}

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

// --- bumpers -------------------------------------------------------------------------------------

TEST(a_bumper_removes_the_drive_in_the_step_that_reads_it_and_then_holds_the_wheels) {
  for (const size_t channel : {0u, 1u}) {
    for (const bool stands : {false, true}) {
      SensorRobot bench(kBumpers);
      const float speed = channel == 0 ? 0.2f : -0.2f;
      bench.drive_on(speed, speed, 30);
      CHECK(bench.driven());
      bench.touch(channel);
      CHECK(!bench.driven());
      CHECK(bench.state() == SupervisorState::kDriving && bench.device.faults() == 0);
      const float next = stands ? 0.0f : speed;
      bench.drive_on(next, next, 300);
      CHECK(bench.brakes() && bench.switched_gently());
    }
  }
}

TEST(the_robot_backs_out_and_is_free_after_a_while) {
  SensorRobot bench(kBumpers);
  bench.touch(0);
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

/// Each wheel counts, however little the robot as a whole goes there.
TEST(no_wheel_turns_towards_a_bumper) {
  for (const size_t channel : {0u, 1u}) {
    const float way = channel == 0 ? 1.0f : -1.0f;
    const float wheels[][2] = {{-0.3001f, 0.3f}, {0.3f, -0.3001f}, {-0.3f, 0.05f}, {0.0f, 0.1f}};
    for (const auto& [left, right] : wheels) {
      SensorRobot bench(kBumpers);
      bench.touch(channel);
      bench.drive_on(way * left, way * right, 300);
      CHECK(!bench.driven() && bench.state() == SupervisorState::kDriving);
    }
    SensorRobot bench(kBumpers);
    bench.touch(channel);
    bench.drive_on(0.0f, way * -0.2f, 100);
    CHECK((channel == 0 ? bench.right.duty() < 0 : bench.right.duty() > 0) &&
          bench.left.duty() == 0);
  }
}

TEST(a_low_battery_slows_the_setpoint_that_is_obeyed_already) {
  SensorRobot bench(kGuard);
  const float top = bench.device.parameter(ParameterId::kMaxVelocityMps);
  CHECK(bench.set(ParameterId::kTtlMaxS, 5.0f) == RefusalCode::kNone);
  bench.send(bench.velocity(top, top, 5'000'000));
  bench.run(1);
  bench.battery.measured_mv = 6700;
  const auto fastest_mps = [&] { return to_mps(bench.device.commanded().left); };
  bench.follow(1900);
  CHECK(fastest_mps() > 0.99f * top);
  bench.follow(1000);
  CHECK(bench.state() == SupervisorState::kDriving && fastest_mps() < 0.51f * top);
}

/// The wheels still roll forward when the program begins to back out: they are not driven at that
/// speed first.
TEST(a_reversal_at_a_bumper_never_drives_forward) {
  SensorRobot bench(kBumpers);
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

/// Wheels that a hand holds while the setpoint reverses: the correction of the following error
/// still commands a speed forward when the setpoint is slewed backward already.
TEST(a_bumper_ends_a_correction_that_still_goes_forward) {
  for (int reversed_for = 1; reversed_for < 200; ++reversed_for) {
    SensorRobot bench(kBumpers);
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

// --- what stops ----------------------------------------------------------------------------------

// --- the battery ---------------------------------------------------------------------------------

TEST(a_battery_s_level_falls_and_rises_by_the_time_beyond_its_bounds) {
  using enum BatteryLevel;
  const std::vector<Course> cases[] = {
      // A sag under load is no empty battery, nor is a start that sags again and again.
      {{1, {{7400, 10, kOk}}}, {10, {{6000, 1900, kOk}, {7400, 260, kOk}}}},
      {{1, {{7400, 10, kOk}}}, {60, {{6000, 300, kOk}, {7400, 350, kOk}}}},
      // Nine tenths of the time below STOP, in drives that are shorter than a sag: it is empty.
      {{1, {{7400, 10, kOk}, {6000, 1800, kOk}, {7400, 200, kOk}, {6000, 300, kStop}}}},
      // A dip amid a sag that stays above the lower bounds. Then it is deep enough for LIMIT all
      // the time, and for STOP with an interruption, in which little leaks.
      {{1,
        {{7400, 10, kOk},
         {6950, 1940, kOk},
         {6300, 100, kWarn},
         {6950, 5000, kWarn},
         {6300, 1990, kWarn},
         {6700, 20, kLimit},
         {6300, 10, kLimit},
         {6300, 10, kStop}}}},
      // It trembles around a 32nd above WARN, 7226 mV, and rises above LIMIT.
      {{1, {{6700, 20, kLimit}}},
       {10, {{7200, 476, kLimit}, {7260, 476, kLimit}}},
       {1, {{7200, 476, kLimit}, {7260, 40, kWarn}}}},
      // Silence charges no battery; what it fell before counts on, and silence adds nothing.
      {{1,
        {{7400, 10, kOk},
         {6300, 2100, kStop},
         {7600, 1000, kStop},
         {0, 9200, kStop},
         {7600, 9900, kStop},
         {7600, 200, kOk},
         {6300, 1500, kOk},
         {0, 700, kOk},
         {6300, 450, kOk},
         {6300, 100, kStop}}}},
  };
  for (const auto& courses : cases) {
    Nobody nobody;
    BenchSensors sensors;
    SensorHub hub(nobody);
    hub.start(sensors, kGuard);
    uint64_t now_us = 0;
    for (const Course& course : courses)
      for (int time = 0; time < course.times; ++time)
        for (const Phase& phase : course.phases) {
          for (int ms = 0; ms < phase.milliseconds; ++ms)
            hub.update(phase.millivolts, now_us += 1000);
          CHECK(hub.battery_level() == phase.level);
        }
  }
}

TEST(a_reset_charges_no_battery) {
  SensorRobot first(kGuard);
  first.battery.measured_mv = 6300;
  first.drive_on(0.2f, 0.2f, 2100);
  CHECK(first.device.faults() == fault::kExternal && !first.driven());
  // Neither does a reset on a board whose list has no levels, such as a list on trial.
  SensorBench second(kBumpers);
  second.battery.measured_mv = 6900;
  second.survive_reset(first).open();
  CHECK(second.clear_fault() == RefusalCode::kNone);
  second.run(20);
  SensorBench third(kGuard);
  third.battery.measured_mv = 6900;
  third.survive_reset(second).open();
  third.drive_on(0.2f, 0.2f, 50);
  CHECK(!third.driven() && third.device.faults() == fault::kExternal);
  third.run(20'000);
  CHECK(third.clear_fault() == RefusalCode::kCausePresent);
  third.battery.measured_mv = 7400;
  third.run(11'000);
  CHECK(third.clear_fault() == RefusalCode::kNone);
}

TEST(a_fault_is_not_cleared_before_its_cause_can_be_read) {
  SensorRobot first(kGuard);
  first.battery.measured_mv = 0;
  first.drive_on(0.2f, 0.2f, 200);
  CHECK(first.device.faults() == fault::kExternal);
  SensorBench second(kGuard);
  second.battery.measured_mv = 0;
  second.survive_reset(first).open();
  for (int i = 0; i < 3; ++i) {
    CHECK(second.clear_fault() == RefusalCode::kCausePresent);
    second.run(500);
  }
  CHECK(second.device.faults() == fault::kExternal);
}

TEST(a_battery_that_was_not_read_yet_refuses_setpoints_and_then_stops) {
  for (const bool has_divider : {true, false}) {
    SensorBench bench(kGuard, has_divider);
    bench.battery.measured_mv = 0;
    bench.open();
    bench.drive(0.2f, 0.2f, 1);
    CHECK(bench.last_refusal() == RefusalCode::kBooting);
    CHECK(bench.state() == SupervisorState::kIdle);
    bench.run(1000);
    bench.drive(0.2f, 0.2f, 1);
    CHECK(bench.last_refusal() == RefusalCode::kFault);
    CHECK(bench.device.faults() == fault::kExternal && !bench.driven());
  }
}

TEST(a_power_sensor_guards_the_battery_also_beside_a_divider_and_stops_if_it_falls_silent) {
  for (const bool has_divider : {false, true}) {
    SensorBench bench(list_of({battery(7000, 6800, 6400), kPowerSensor}), has_divider);
    measure(bench, 7400);
    bench.open();
    for (int i = 0; i < 10; ++i) {
      measure(bench, 7400);
      bench.drive_on(0.2f, 0.2f, 100);
    }
    measure(bench, has_divider ? 5800 : 7400);
    bench.drive_on(0.2f, 0.2f, 195);
    CHECK(bench.driven() && bench.device.faults() == 0);
    for (int i = 0; i < 20; ++i) {
      if (has_divider) measure(bench, 5800);
      bench.drive_on(0.2f, 0.2f, has_divider ? 100 : 1);
    }
    CHECK(!bench.driven() && bench.device.faults() == fault::kExternal);
  }
}

TEST(charge_is_counted_while_the_current_is_measured) {
  Nobody nobody;
  const PeripheralList list = list_of({kPowerSensor});
  BenchSensors sensors;
  SensorHub hub(nobody);
  hub.start(sensors, list);
  const auto measure = [&](uint64_t t_us, int32_t milliamperes) {
    sensors.power =
        PowerReading{.state = SensorState::kOk, .t_us = t_us, .current_ma = milliamperes};
    hub.update(0, t_us + 500);
    return hub.used_mah();
  };
  constexpr uint64_t kHourUs = 3'600'000'000;
  constexpr uint64_t kReadingUs = SensorHub::kPowerPeriodUs;
  // The sensors' task was there before the control task's first step.
  hub.update(0, kReadingUs);
  CHECK(measure(10, 36'000) == 0.0f);
  CHECK(std::abs(measure(10 + kReadingUs, 36'000) - 1.0f) < 1e-5f);
  // It flows back while a motor brakes.
  CHECK(std::abs(measure(10 + 2 * kReadingUs, -36'000)) < 1e-5f);
  // The charge drawn in an hour of steps without a reading is unknown.
  hub.update(0, kHourUs - 1000);
  hub.update(0, kHourUs);
  CHECK(hub.state(0) == SensorState::kMissed);
  CHECK(std::abs(measure(kHourUs, 36'000)) < 1e-5f);
  // A day at 10 mA.
  for (uint64_t t_us = kHourUs; t_us < 25 * kHourUs; t_us += kReadingUs)
    measure(t_us + kReadingUs, 10);
  CHECK(std::abs(hub.used_mah() - 240.0f) < 0.1f);
}

// --- what the host is sent -----------------------------------------------------------------------

TEST(a_reading_is_never_sent_again_and_its_absence_is_named) {
  SensorRobot bench(list_of({kImu}));
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
  SensorRobot bench(list_of({kImu, bumper(Place::kFront)}));
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

TEST(a_measured_range_is_sent_once_and_only_if_it_can_be_used) {
  SensorBench bench(list_of({kRangeSensor}));
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

TEST(on_a_slow_line_states_go_before_ranges_and_these_before_an_imu) {
  const double state = frame_size(WheelState::kSize);
  const double imu = frame_size(Imu::kSize);
  const struct {
    PeripheralList list;
    uint16_t state_rate_hz;
    double others;  ///< Bytes per second of all but the IMU.
    bool leaves_room;
  } cases[] = {
      {list_of({kImu}), 150, 150 * state, true},
      {list_of({kRangeSensor, kImu}), 100, 100 * state + 17 * frame_size(Range::kSize), true},
      {list_of({kImu}), 188, 188 * state, false},
  };
  for (const auto& one : cases) {
    SensorBench bench(one.list);
    bench.line.rate = 11'520;
    bench.open();
    CHECK(bench.refusal(SetStreamRate{.rate_hz = one.state_rate_hz}) == RefusalCode::kNone);
    bench.received.clear();
    bench.refusal(SensorStream{.rate_hz = 200});
    bench.run(3);
    const auto events = bench.of<SensorEvent>();
    CHECK(!events.empty() && events[0].code == SensorEventCode::kReduced);
    const uint16_t rate_hz = bench.of<SensorInfo>()[0].rate_hz;
    CHECK(!events.empty() && events[0].value == rate_hz && rate_hz < 200);
    const double bytes = one.others + rate_hz * imu;
    if (one.leaves_room) CHECK(bytes <= 0.8 * 11'520 && bytes > 0.75 * 11'520);
    CHECK((rate_hz > 0) == one.leaves_room);
  }
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
  SensorRobot bench(kAnalog);
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
