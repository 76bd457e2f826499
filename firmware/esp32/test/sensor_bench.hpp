// A robot with peripherals: `RobotBench` with inputs and readings made of variables.
#pragma once

#include <numbers>
#include <optional>

#include "built_in_boards.hpp"
#include "robot_bench.hpp"
#include "sensor_server.hpp"

namespace wheelwire::test {

struct BenchSensors final : SensorPort {
  uint16_t at_pins = 0;
  std::optional<ImuReading> imu;
  std::optional<PowerReading> power;
  std::optional<RangeReading> range;
  std::optional<AnalogReading> analog;

  uint16_t levels() override { return at_pins; }
  bool take(size_t, ImuReading& out) override { return take(imu, out); }
  bool take(size_t, PowerReading& out) override { return take(power, out); }
  bool take(size_t, RangeReading& out) override { return take(range, out); }
  bool take(size_t, AnalogReading& out) override { return take(analog, out); }

 private:
  template <typename Reading>
  static bool take(std::optional<Reading>& from, Reading& out) {
    if (!from) return false;
    out = *from;
    from.reset();
    return true;
  }
};

/// Sensors from their pins to the hub, in steps of 100 us: the control task each millisecond, the
/// sensors' task as a rig says. It has no readings, and hears nothing, but what a rig overrides.
class HubRig : public SensorPort, public SensorObserver {
 public:
  void run(uint64_t duration_us) {
    for (const uint64_t end_us = now_us_ + duration_us; now_us_ < end_us; now_us_ += 100) {
      poll();
      if (now_us_ % 1000 == 500) hub_.update(0, now_us_);
    }
  }
  SensorState state(size_t channel = 0) const { return hub_.state(channel); }
  /// How long it takes until the hub says so.
  uint64_t until(SensorState state, size_t channel = 0) {
    const uint64_t start_us = now_us_;
    while (this->state(channel) != state && now_us_ < start_us + 5'000'000) run(100);
    return now_us_ - start_us;
  }

  uint16_t levels() override { return 0; }
  bool take(size_t, ImuReading&) override { return false; }
  bool take(size_t, PowerReading&) override { return false; }
  bool take(size_t, RangeReading&) override { return false; }
  bool take(size_t, AnalogReading&) override { return false; }
  void on_sensor_event(SensorEventCode, size_t, uint16_t, uint64_t) override {}
  void on_reading(size_t, const ImuReading&, uint16_t) override {}
  void on_reading(size_t, const RangeReading&, uint16_t) override {}

 protected:
  ~HubRig() = default;
  /// What happens at this time.
  virtual void poll() = 0;

  PeripheralList list_;
  SensorHub hub_{*this};
  uint64_t now_us_ = 0;
};

inline PeripheralList list_of(std::initializer_list<Peripheral> entries) {
  PeripheralList list;
  for (const Peripheral& entry : entries) list.entries[list.count++] = entry;
  return list;
}

constexpr Peripheral kImu{.kind = PeripheralKind::kImu,
                          .chip = SensorChip::kMpu6050,
                          .pin_a = 16,
                          .pin_b = 17,
                          .pin_c = 35,
                          .forward = Axis::kY,
                          .up = Axis::kZ};
constexpr Peripheral kPowerSensor{.kind = PeripheralKind::kPower,
                                  .chip = SensorChip::kIna219,
                                  .pin_a = 16,
                                  .pin_b = 17,
                                  .value_a = 1000};
constexpr Peripheral kRangeSensor{.kind = PeripheralKind::kRange,
                                  .chip = SensorChip::kHcSr04,
                                  .place = Place::kFront,
                                  .pin_a = 21,
                                  .pin_b = 34};
inline Peripheral bumper(Place place, int8_t pin = 36) {
  return {.kind = PeripheralKind::kBumper, .place = place, .pin_a = pin};
}
inline Peripheral battery(uint16_t warn_mv, uint16_t limit_mv, uint16_t stop_mv) {
  return {.kind = PeripheralKind::kBattery,
          .value_a = warn_mv,
          .value_b = limit_mv,
          .value_c = stop_mv};
}

class SensorBench : public RobotBench {
 public:
  explicit SensorBench(const PeripheralList& peripherals, bool has_divider = true)
      : list(peripherals) {
    device.sense(server.emplace(list, &sensors, has_divider ? &battery : nullptr));
  }

  void set_level(size_t channel, bool high) {
    const auto bit = static_cast<uint16_t>(1u << channel);
    sensors.at_pins = static_cast<uint16_t>(high ? sensors.at_pins | bit : sensors.at_pins & ~bit);
  }
  /// Triggers an input, and a step.
  void touch(size_t channel) {
    set_level(channel, true);
    step();
  }
  /// Commands it before each step, as a program does that streams; the wheels do as commanded.
  void drive_on(float left_mps, float right_mps, int steps) {
    for (int i = 0; i < steps; ++i) {
      send(velocity(left_mps, right_mps));
      follow(1);
    }
  }
  /// The wheels do as commanded.
  void follow(int steps) {
    for (int i = 0; i < steps; ++i) {
      const WheelPair commanded = device.commanded();
      turn(ticks(commanded.left, rest_[0]), ticks(commanded.right, rest_[1]));
      step();
    }
  }

  PeripheralList list;
  BenchSensors sensors;
  std::optional<SensorServer> server;

 private:
  /// Ticks of one control period at this velocity; `rest` is the remaining part of a tick.
  int ticks(int32_t umps, double& rest) const {
    const double around_m = 2 * std::numbers::pi * device.parameter(ParameterId::kWheelRadius);
    const double whole =
        rest + umps * 1e-9 / around_m * device.parameter(ParameterId::kCountsPerRevolution);
    const int count = static_cast<int>(whole);
    rest = whole - count;
    return count;
  }

  double rest_[2]{};
};

/// One that is ready to drive.
struct SensorRobot : SensorBench {
  explicit SensorRobot(const PeripheralList& peripherals, bool has_divider = true)
      : SensorBench(peripherals, has_divider) {
    open();
  }
};

}  // namespace wheelwire::test
