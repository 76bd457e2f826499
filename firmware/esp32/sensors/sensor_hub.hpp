// What a board's peripherals measure, whether it can be used, and what it forbids. Called once in
// each control step; asks no chip and waits for nothing.
#pragma once

#include "battery_guard.hpp"
#include "latches.hpp"
#include "peripherals.hpp"
#include "sensor_port.hpp"

namespace wheelwire {

/// Called within `update`.
class SensorObserver {
 public:
  virtual void on_sensor_event(SensorEventCode code, size_t channel, uint16_t value,
                               uint64_t now_us) = 0;
  virtual void on_reading(size_t channel, const ImuReading& reading, uint16_t sample) = 0;
  virtual void on_reading(size_t channel, const RangeReading& reading, uint16_t sample) = 0;

 protected:
  ~SensorObserver() = default;
};

class SensorHub {
 public:
  /// A sensor that was not read within this after the start is not only unread: it is missing.
  static constexpr uint64_t kFirstReadUs = 1'000'000;
  /// An input that was triggered is free again when it was free for this long: a switch bounces.
  static constexpr uint64_t kReleaseUs = 50'000;
  /// A battery divider that reads 0 mV for this long counts as broken.
  static constexpr uint64_t kZeroUs = 100'000;
  /// Time from one reading to the next, at most half of what makes a sensor stale.
  static constexpr uint32_t kImuPeriodUs = 5'000;
  static constexpr uint32_t kPowerPeriodUs = 100'000;
  static constexpr uint32_t kAnalogPeriodUs = 100'000;

  explicit SensorHub(SensorObserver& observer) : observer_(observer) {}

  /// Reads these from now on; both must outlive it.
  void start(SensorPort& port, const PeripheralList& list);

  /// Before the first `update`: the battery was at STOP before the reset, and stays there until it
  /// was charged. A list without its levels keeps that for the next one.
  void start_at_stop();

  /// Reads all. Returns what is forbidden until the next call, as flags of `reflex`, with
  /// kBatteryAtStop.
  /// `divider_mv`: of the battery, by the board's divider; 0: it is not measured.
  uint8_t update(uint16_t divider_mv, uint64_t now_us);

  const PeripheralList& list() const { return *list_; }
  SensorState state(size_t channel) const { return channels_[channel].state; }
  /// Identity of a wrong chip in its place; 0: no wrong chip.
  uint16_t identity(size_t channel) const { return channels_[channel].identity; }
  uint8_t reflexes() const { return reflexes_; }
  /// Which of them hold the robot, as flags of `held`. Call it after the first `update`.
  uint32_t held() const;
  uint16_t levels() const { return levels_; }
  /// The inputs that act on the robot: bit n is channel n.
  uint16_t triggered() const { return triggered_; }
  uint16_t stale() const;
  /// Level of a digital input; 0 for others.
  uint16_t edges(size_t channel) const {
    return (inputs_ >> channel & 1) != 0 ? channels_[channel].count : uint16_t{0};
  }
  BatteryLevel battery_level() const { return battery_.level(); }
  /// Voltage from the power sensor, or from the divider.
  const PowerReading& power() const { return power_; }
  /// Drawn since the start, as far as the power sensor measured it.
  float used_mah() const;
  /// The channel whose Power is sent; -1: none.
  int power_channel() const { return power_channel_; }
  /// Time from one measurement of a range sensor to its next.
  uint32_t range_round_us() const { return range_round_us_; }
  /// Voltage before the divider, by the input's index; 0: missing or unusable.
  uint16_t analog_mv(size_t index) const { return analog_mv_[index]; }

 private:
  struct Channel {
    SensorState state = SensorState::kUnread;
    uint16_t identity = 0;
    uint16_t count = 0;  // Samples of an IMU or a range sensor, edges of an input.
    uint64_t seen_us = 0;
  };

  void read_inputs(uint64_t now_us);
  void read_imu(size_t channel, uint64_t now_us);
  void read_power(size_t channel, uint64_t now_us);
  void read_range(size_t channel, uint64_t now_us);
  void read_analog(size_t channel, uint64_t now_us);
  void read_battery(size_t channel, uint16_t divider_mv, uint64_t now_us);
  bool note_state(size_t channel, SensorState state, uint64_t now_us, uint16_t identity = 0);
  /// The state of a sensor that gave nothing new.
  SensorState overdue(size_t channel, uint32_t period_us, uint64_t now_us) const;
  uint8_t reflex_of(const Peripheral& entry) const;
  bool guards_battery() const;

  SensorObserver& observer_;
  SensorPort* port_ = nullptr;
  const PeripheralList* list_ = nullptr;
  bool started_ = false;
  uint8_t reflexes_ = reflex::kUnread;
  uint16_t inputs_ = 0;  // Channels that are digital inputs,
  uint16_t low_ = 0;     // and those that trigger at the low level.
  uint16_t levels_ = 0;
  uint16_t triggered_ = 0;
  uint64_t start_us_ = 0;
  uint64_t updated_us_ = 0;  // The update before this one.
  Channel channels_[kMostPeripherals];
  uint32_t range_round_us_ = 0;
  uint16_t analog_mv_[kMostAnalog]{};
  int power_channel_ = -1;
  int battery_channel_ = -1;
  PowerReading power_;
  int64_t used_ma_us_ = 0;  // A sum of floats would lose small currents after a day.
  BatteryGuard battery_;
  bool is_at_stop_ = false;
};

}  // namespace wheelwire
