// The emergency-stop contact to ground, against a pull-up.
#pragma once

#include "esp_rom_sys.h"
#include "gpio_pin.hpp"
#include "hal.hpp"

namespace wheelwire {

/// With a normally-closed contact, a pressed button, a broken wire and a pulled plug all read high.
class EstopContact final : public EstopInput {
 public:
  /// Without a pin it counts as closed: the parameter says that no contact is fitted.
  bool start(const BoardDescription& board) {
    pin_ = board.estop;
    level_ = board.estop_contact == ContactKind::kNormallyClosed;
    if (pin_ < 0) return true;
    return configure(mask_of(pin_), GPIO_MODE_INPUT, {.up = true});
  }

  /// Takes two samples, because an open contact latches. The pull-up is weak, some 45 kOhm, so the
  /// motors' wires, which run next to the contact's, may cause spikes. These pass within
  /// microseconds; a press lasts for milliseconds. If bounce spoils one sample, the next control
  /// step sees the press; a broken wire stays broken. So a stop comes one step later at worst.
  bool is_open() override {
    if (!says_stop()) return false;
    esp_rom_delay_us(kApartUs);
    return says_stop();
  }

 private:
  /// Four time constants of the pull-up with 100 pF of wire. It is spent only while a sample says
  /// stop.
  static constexpr uint32_t kApartUs = 20;

  bool says_stop() const { return pin_ >= 0 && is_high(pin_) == level_; }

  int pin_ = -1;
  bool level_ = true;  ///< The level that means an e-stop.
};

}  // namespace wheelwire
