// Bumpers, cliff sensors and fault outputs: the levels of their pins.
#pragma once

#include "peripherals.hpp"

namespace wheelwire {

class DigitalInputs {
 public:
  bool start(const PeripheralList& list);

  /// Bit n is the level of channel n. A level has changed when two samples say so: what is
  /// triggered stops the robot, and may latch. See EstopContact.
  uint16_t levels();

 private:
  /// Four time constants of a pull-up with 100 pF of wire. It is spent only while a level changes.
  static constexpr uint32_t kApartUs = 20;

  uint16_t sample() const;

  int8_t pins_[kMostPeripherals];  // By channel; -1: not an input.
  uint16_t levels_ = 0;
};

}  // namespace wheelwire
