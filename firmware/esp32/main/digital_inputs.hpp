// Bumpers, cliff sensors and fault outputs: the levels of their pins.
#pragma once

#include "esp_rom_sys.h"
#include "gpio_pin.hpp"
#include "peripherals.hpp"

namespace wheelwire {

class DigitalInputs {
 public:
  bool start(const PeripheralList& list) {
    bool is_started = true;
    for (int8_t& pin : pins_) pin = -1;
    for (size_t i = 0; i < list.count; ++i) {
      const Peripheral& entry = list.entries[i];
      if (!is_digital_input(entry.kind)) continue;
      pins_[i] = entry.pin_a;
      const Pulls pulls{.up = (entry.flags & peripheralflag::kPullUp) != 0,
                        .down = (entry.flags & peripheralflag::kPullDown) != 0};
      is_started = configure(mask_of(entry.pin_a), GPIO_MODE_INPUT, pulls) && is_started;
    }
    // A pull-up charges its wire.
    esp_rom_delay_us(kApartUs);
    levels_ = sample();
    return is_started;
  }

  /// Bit n is the level of channel n. A level has changed when two samples say so: what is
  /// triggered stops the robot, and may latch. See EstopContact.
  uint16_t levels() {
    const auto changed = static_cast<uint16_t>(sample() ^ levels_);
    if (changed == 0) return levels_;
    esp_rom_delay_us(kApartUs);
    levels_ = static_cast<uint16_t>(levels_ ^ (changed & (sample() ^ levels_)));
    return levels_;
  }

 private:
  /// Four time constants of a pull-up with 100 pF of wire. It is spent only while a level changes.
  static constexpr uint32_t kApartUs = 20;

  uint16_t sample() const {
    uint16_t levels = 0;
    for (size_t i = 0; i < kMostPeripherals; ++i)
      if (pins_[i] >= 0 && is_high(pins_[i])) levels |= static_cast<uint16_t>(1u << i);
    return levels;
  }

  int8_t pins_[kMostPeripherals];  // By channel; -1: not an input.
  uint16_t levels_ = 0;
};

}  // namespace wheelwire
