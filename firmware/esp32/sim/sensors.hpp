// A board's peripherals in the simulated world: what the firmware reads of them.
#pragma once

#include <array>

#include "i2c_chips.hpp"
#include "peripherals.hpp"
#include "sensor_port.hpp"

namespace wheelwire::sim {

class SimulatedBoard;

/// The simulated robot's own peripherals, on its default board.
PeripheralList default_peripherals();

class Sensors final : public SensorPort {
 public:
  Sensors(const SimulatedBoard& board, uint64_t seed) : chips(board, seed), board_(board) {}

  /// Bumpers that are pressed, cliffs that see no floor, power stages that have tripped, by Place.
  std::array<bool, 7> bumpers{};
  std::array<bool, 7> cliffs{};
  bool stage_fault = false;
  I2cChips chips;

  /// The firmware reads this list from now on.
  void take_up(const PeripheralList& list) {
    list_ = list;
    chips.take_up(list);
  }

  /// After each step of the physics; see I2cChips.
  void advance(bool is_running) { chips.advance(is_running); }

  uint16_t levels() override;
  bool take(size_t channel, ImuReading& out) override { return chips.take(channel, out); }
  bool take(size_t channel, PowerReading& out) override { return chips.take(channel, out); }

 private:
  bool is_triggered(const Peripheral& entry) const;

  const SimulatedBoard& board_;
  PeripheralList list_;
};

}  // namespace wheelwire::sim
