// The simulated range sensors, each with its own truth.
#include "range_sensors.hpp"

#include "check.hpp"
#include "sensed_board.hpp"

using namespace wheelwire;
using namespace wheelwire::sim;
using namespace wheelwire::test;

namespace {

constexpr Peripheral range_entry(Place place, int8_t trigger, int8_t echo) {
  return {.kind = PeripheralKind::kRange,
          .chip = SensorChip::kHcSr04,
          .place = place,
          .pin_a = trigger,
          .pin_b = echo};
}

constexpr Peripheral kImu{
    .kind = PeripheralKind::kImu, .chip = SensorChip::kMpu6050, .pin_a = 16, .pin_b = 17};

double& distance_m(SensedBoard& bench, Place place) {
  return bench.board.sensors.ranges.world.distance_m[static_cast<size_t>(place)];
}

}  // namespace

TEST(each_range_sensor_measures_what_is_on_its_side) {
  SensedBoard bench({range_entry(Place::kFront, 21, 34), range_entry(Place::kLeft, 5, 35),
                     range_entry(Place::kRight, 12, 36)});
  distance_m(bench, Place::kFront) = 0.5;
  distance_m(bench, Place::kLeft) = 3.0;
  distance_m(bench, Place::kRight) = 10.0;
  bench.run(2000);
  const int expected_mm[] = {500, 3000, 0};
  for (size_t channel = 0; channel < 3; ++channel) {
    const auto& found = bench.ranges[channel];
    CHECK(found.size() >= 10 && found.size() <= 11);
    for (const RangeReading& reading : found) {
      CHECK(reading.state == SensorState::kOk && reading.distance_mm == expected_mm[channel]);
      CHECK((reading.quality == RangeQuality::kFar) == (channel == 2));
    }
  }
}

TEST(a_bus_that_hangs_keeps_the_task_and_the_ranges_are_measured_all_the_same) {
  SensedBoard bench({kImu, range_entry(Place::kFront, 21, 34)});
  bench.board.sensors.chips.imu.bus_hung = true;
  bench.run(2000);
  CHECK(bench.ranges[1].size() >= 28);
  for (const RangeReading& reading : bench.ranges[1]) CHECK(reading.distance_mm == 1000);
}

/// Its wires lead to where the other board has a motor.
TEST(a_range_sensor_on_the_pins_of_another_board_is_absent) {
  SensedBoard bench({range_entry(Place::kFront, 21, 34)});
  bench.board.wire(kBoardDrv8833);  // Its standby is at GPIO 21.
  bench.run(300);
  CHECK(!bench.ranges[0].empty());
  for (const RangeReading& reading : bench.ranges[0]) CHECK(reading.state == SensorState::kAbsent);
}

TEST(a_start_of_the_firmware_begins_anew) {
  SensedBoard bench({range_entry(Place::kFront, 21, 34)});
  bench.run(63);  // It listens now.
  bench.board.reset();
  bench.start();
  bench.run(500);
  CHECK(bench.ranges[0].size() >= 7);
  for (const RangeReading& reading : bench.ranges[0]) {
    CHECK(reading.state == SensorState::kOk && reading.t_us <= bench.board.device_us());
    CHECK(reading.distance_mm == 1000);
  }
}
