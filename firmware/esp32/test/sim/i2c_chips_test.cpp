// The simulated chips on an I2C bus, read by the firmware's drivers.
#include "i2c_chips.hpp"

#include <cmath>

#include "check.hpp"
#include "sensed_board.hpp"

using namespace wheelwire;
using namespace wheelwire::sim;
using namespace wheelwire::test;

namespace {

constexpr Peripheral imu_entry(SensorChip chip, Axis forward, Axis up, int8_t interrupt = -1) {
  return {.kind = PeripheralKind::kImu,
          .chip = chip,
          .pin_a = 16,
          .pin_b = 17,
          .pin_c = interrupt,
          .forward = forward,
          .up = up};
}

constexpr Peripheral power_entry(SensorChip chip, uint16_t shunt_100uohm) {
  return {.kind = PeripheralKind::kPower,
          .chip = chip,
          .pin_a = 16,
          .pin_b = 17,
          .value_a = shunt_100uohm};
}

double mean(const std::vector<ImuReading>& readings, int16_t (ImuReading::*field)[3], size_t i) {
  double sum = 0.0;
  for (const ImuReading& reading : readings) sum += (reading.*field)[i];
  return sum / static_cast<double>(readings.size());
}

bool is_near(double value, double expected, double within) {
  return std::abs(value - expected) <= within;
}

/// The rotation that maps the axes of a robot at `tilt` to a level robot's, column by column.
struct Attitude {
  explicit Attitude(const Tilt& tilt) {
    const double sr = std::sin(tilt.roll_rad), cr = std::cos(tilt.roll_rad);
    const double sp = std::sin(tilt.pitch_rad), cp = std::cos(tilt.pitch_rad);
    const double rows[3][3] = {{cp, sp * sr, sp * cr}, {0, cr, -sr}, {-sp, cp * sr, cp * cr}};
    for (size_t i = 0; i < 3; ++i)
      for (size_t j = 0; j < 3; ++j) to_level[i][j] = rows[i][j];
  }
  double to_level[3][3];
};

}  // namespace

TEST(each_imu_of_the_tables_measures_in_its_own_axes_and_counts) {
  for (const ImuTable& table : kImuTables) {
    // Forward is -z, up is x: left is y, which is x cross -z.
    for (const int8_t interrupt : {int8_t{-1}, int8_t{35}}) {
      SensedBoard bench{{imu_entry(table.chip, Axis::kMinusZ, Axis::kX, interrupt)}};
      PlantModel model = bench.board.plant.model();
      model.slope_rad = 0.1;
      model.wheels[kLeft].blocked = model.wheels[kRight].blocked = true;
      bench.board.plant.configure(model);
      bench.board.sensors.chips.imu.bias_radps = 0.2;
      bench.run(300);
      bench.run(2000);
      CHECK(is_near(static_cast<double>(bench.imus.size()), 400, 18));
      const double g = 9.80665 / table.accelerometer_mps2;
      CHECK(is_near(mean(bench.imus, &ImuReading::accelerometer, 0), g * std::cos(0.1), 5));
      CHECK(is_near(mean(bench.imus, &ImuReading::accelerometer, 1), 0, 5));
      CHECK(is_near(mean(bench.imus, &ImuReading::accelerometer, 2), -g * std::sin(0.1), 5));
      CHECK(is_near(mean(bench.imus, &ImuReading::gyro, 0), 0.2 / table.gyro_radps, 1));
      CHECK(is_near(mean(bench.imus, &ImuReading::gyro, 2), 0, 1));
      CHECK(is_near(bench.imus.back().temperature_cdeg, 3000, 5));
      for (const ImuReading& reading : bench.imus) CHECK(reading.state == SensorState::kOk);
    }
  }
}

TEST(a_power_sensor_measures_the_motors_supply) {
  for (const SensorChip chip : {SensorChip::kIna219, SensorChip::kIna226}) {
    SensedBoard bench{{power_entry(chip, 500)}};
    PlantModel model = bench.board.plant.model();
    model.supply_ohm = 0.2;
    bench.board.plant.configure(model);
    bench.run(1000);
    CHECK(bench.powers.size() >= 8);
    CHECK(is_near(bench.powers.back().voltage_mv, model.bridge.supply_v * 1e3, 5));
    CHECK(bench.powers.back().current_ma == 0);
    bench.board.hal().left_motor.drive(20'000);
    bench.board.hal().right_motor.drive(20'000);
    bench.run(1000);
    const double drawn_a = bench.board.plant.drawn_a(bench.board.bridges());
    CHECK(drawn_a > 0.02);
    CHECK(is_near(bench.powers.back().current_ma, drawn_a * 1e3, 20));
    CHECK(is_near(bench.powers.back().voltage_mv, bench.board.plant.supply_v() * 1e3, 10));
  }
}

TEST(a_bus_on_a_pin_that_is_wired_to_something_else_has_no_chip) {
  SensedBoard bench{{imu_entry(SensorChip::kMpu6050, Axis::kX, Axis::kZ)}};
  BoardDescription wired = kBoardL298n;
  wired.left_encoder_a = 17;
  bench.board.wire(wired);
  bench.run(10);
  CHECK(!bench.imus.empty() && bench.imus.back().state == SensorState::kAbsent);
}

TEST(samples_go_on_after_a_reset_of_the_processor) {
  SensedBoard bench{{imu_entry(SensorChip::kMpu6050, Axis::kX, Axis::kZ, 35)}};
  bench.run(500);
  bench.board.reset();
  bench.start();
  bench.run(500);
  CHECK(bench.imus.size() >= 75 && bench.imus.back().state == SensorState::kOk);
  for (const ImuReading& reading : bench.imus) CHECK(reading.t_us <= bench.board.device_us());
}

TEST(a_tilted_imu_sees_gravity_turn_and_the_tilt_itself) {
  const double g = 9.80665;
  const struct {
    Tilt tilt;
    double expected[3];
  } cases[] = {
      {{}, {0, 0, g}},
      {{.pitch_rad = 0.5}, {-g * std::sin(0.5), 0, g * std::cos(0.5)}},  // nose down
      {{.roll_rad = 0.5}, {0, g * std::sin(0.5), g * std::cos(0.5)}},    // right side down
      {{.pitch_rad = -1.5}, {g * std::sin(1.5), 0, g * std::cos(1.5)}},
      {{.roll_rad = 0.4, .pitch_rad = -0.3},
       {g * std::sin(0.3), g * std::cos(0.3) * std::sin(0.4), g * std::cos(0.3) * std::cos(0.4)}},
  };
  for (const auto& one : cases) {
    SensedBoard bench{{imu_entry(SensorChip::kMpu6050, Axis::kX, Axis::kZ)}};
    const ImuTable& table = *imu_table_of(SensorChip::kMpu6050);
    bench.run(300);
    bench.board.plant.held = one.tilt;
    bench.run(2000);
    // Rates that turn the robot's axes from level to the tilt, sample by sample.
    double to_level[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (const ImuReading& reading : bench.imus) {
      for (auto& row : to_level) {
        double w[3];
        for (size_t i = 0; i < 3; ++i) w[i] = reading.gyro[i] * table.gyro_radps * 0.005;
        const double next[3] = {row[0] + row[1] * w[2] - row[2] * w[1],
                                row[1] + row[2] * w[0] - row[0] * w[2],
                                row[2] + row[0] * w[1] - row[1] * w[0]};
        std::copy(next, next + 3, row);
      }
    }
    const Attitude expected(one.tilt);
    for (size_t i = 0; i < 3; ++i)
      for (size_t j = 0; j < 3; ++j) CHECK(is_near(to_level[i][j], expected.to_level[i][j], 0.02));
    bench.run(500);
    for (size_t i = 0; i < 3; ++i)
      CHECK(is_near(mean(bench.imus, &ImuReading::accelerometer, i) * table.accelerometer_mps2,
                    one.expected[i], 0.05));
  }
}
