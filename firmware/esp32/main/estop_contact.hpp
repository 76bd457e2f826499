// The emergency-stop contact to ground, against a pull-up.
#pragma once

#include "board_rules.hpp"
#include "driver/gpio.h"
#include "esp_rom_sys.h"
#include "hal.hpp"

namespace wheelwire {

/// With a normally-closed contact, a pressed button, a broken wire and a pulled plug all read high.
class EstopContact final : public EstopInput {
 public:
  /// Without a pin it counts as closed: the parameter says that no contact is fitted.
  bool start(const BoardDescription& board) {
    pin_ = board.estop;
    level_ = board.estop_contact == ContactKind::kNormallyClosed ? 1 : 0;
    if (pin_ < 0) return true;
    const gpio_config_t config = {
        .pin_bit_mask = mask_of(pin_),
        .mode = GPIO_MODE_INPUT,
        .pull_up_en = GPIO_PULLUP_ENABLE,
        .pull_down_en = GPIO_PULLDOWN_DISABLE,
        .intr_type = GPIO_INTR_DISABLE,
    };
    return gpio_config(&config) == ESP_OK;
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

  bool says_stop() const {
    return pin_ >= 0 && gpio_get_level(static_cast<gpio_num_t>(pin_)) == level_;
  }

  int pin_ = -1;
  int level_ = 1;  ///< The level that means an e-stop.
};

}  // namespace wheelwire
