// A simulated board with peripherals, whose readings are taken each millisecond.
#pragma once

#include <map>
#include <vector>

#include "board.hpp"
#include "shipped_boards.hpp"

namespace wheelwire::test {

struct SensedBoard {
  explicit SensedBoard(std::initializer_list<Peripheral> entries) {
    for (const Peripheral& entry : entries) list.entries[list.count++] = entry;
    start();
  }
  void start() {
    board.take_up(sim::kBoardL298n);
    board.sensors.take_up(list);
  }

  /// The readings of these milliseconds are then the newest ones.
  void run(int milliseconds) {
    imus.clear();
    powers.clear();
    ranges.clear();
    analogs.clear();
    for (int i = 0; i < milliseconds; ++i) {
      board.run_until(board.now() + 1'000'000, true);
      for (size_t channel = 0; channel < list.count; ++channel) {
        take(channel, imus);
        take(channel, powers);
        take(channel, ranges[channel]);
        take(channel, analogs[channel]);
      }
    }
  }

  sim::SimulatedBoard board{1};
  PeripheralList list;
  std::vector<ImuReading> imus;
  std::vector<PowerReading> powers;
  std::map<size_t, std::vector<RangeReading>> ranges;  ///< By channel.
  std::map<size_t, std::vector<AnalogReading>> analogs;

 private:
  template <typename Reading>
  void take(size_t channel, std::vector<Reading>& readings) {
    Reading reading;
    if (board.sensors.take(channel, reading)) readings.push_back(reading);
  }
};

}  // namespace wheelwire::test
