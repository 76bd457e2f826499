// The chip's GPIOs: what the firmware does with each of them, by number.
#pragma once

#include <array>
#include <utility>

#include "board_rules.hpp"
#include "hal.hpp"

namespace wheelwire::sim {

class ChipPins {
 public:
  /// Makes the pin an output; 0 is low, kHigh_q15 is high. Without a pin (-1) nothing happens.
  void drive(int pin, uint16_t duty_q15) {
    if (pin < 0 || (is_driven(pin) && this->duty_q15(pin) == duty_q15)) return;
    driven_ |= mask_of(pin);
    changed_ |= mask_of(pin);
    duty_q15_[static_cast<size_t>(pin)] = duty_q15;
  }
  /// Makes the pin an input with the chip's own pull-up.
  void pull_up(int pin) {
    driven_ &= ~mask_of(pin);
    pulled_up_ |= mask_of(pin);
    changed_ |= mask_of(pin);
  }

  PinMask driven() const { return driven_; }
  bool is_driven(int pin) const { return (driven_ & mask_of(pin)) != 0; }
  bool is_pulled_up(int pin) const { return (pulled_up_ & mask_of(pin)) != 0; }
  /// Level of a driven pin.
  uint16_t duty_q15(int pin) const { return duty_q15_[static_cast<size_t>(pin)]; }

  /// The pins that have changed since the last call.
  PinMask take_changed() { return std::exchange(changed_, 0); }

 private:
  PinMask changed_ = ~PinMask{0};
  PinMask driven_ = 0;
  PinMask pulled_up_ = 0;
  std::array<uint16_t, 64> duty_q15_{};
};

}  // namespace wheelwire::sim
