// A board's peripherals in the simulated world: what the firmware reads of them.
#pragma once

#include <array>

#include "i2c_chips.hpp"
#include "mailbox.hpp"
#include "peripherals.hpp"
#include "range_sensors.hpp"
#include "sensor_port.hpp"

namespace wheelwire::sim {

class SimulatedBoard;

class Sensors final : public SensorPort {
 public:
  Sensors(const SimulatedBoard& board, uint64_t seed)
      : chips(board, seed), ranges(board), board_(board) {}

  /// Bumpers that are pressed, cliffs that see no floor, power stages that have tripped, by Place.
  std::array<bool, kPlaces> bumpers{};
  std::array<bool, kPlaces> cliffs{};
  bool stage_fault = false;
  /// At the analogue inputs, before their dividers [V].
  std::array<double, kMostAnalog> analog_v{};
  bool analog_failed = false;  ///< The ADC gives no reading.
  I2cChips chips;
  RangeSensors ranges;

  /// The firmware reads this list from now on.
  void take_up(const PeripheralList& list);

  /// After each step of the physics. `is_running`: the firmware's tasks are.
  void advance(bool is_running);

  uint16_t levels() override;
  bool take(size_t channel, ImuReading& out) override { return chips.sensors.take(channel, out); }
  bool take(size_t channel, PowerReading& out) override { return chips.sensors.take(channel, out); }
  bool take(size_t channel, RangeReading& out) override { return ranges.finder.take(channel, out); }
  bool take(size_t channel, AnalogReading& out) override { return analog_[channel].take(out); }

 private:
  void measure_analog();
  uint16_t pin_mv(const Peripheral& entry) const;
  bool is_triggered(const Peripheral& entry) const;

  const SimulatedBoard& board_;
  PeripheralList list_;
  std::array<Mailbox<AnalogReading>, kMostPeripherals> analog_;
  uint64_t next_analog_us_ = 0;
};

}  // namespace wheelwire::sim
