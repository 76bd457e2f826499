// The emergency-stop contact to ground, against a pull-up.
#pragma once

#include "board_rules.hpp"
#include "driver/gpio.h"
#include "hal.hpp"

namespace wheelwire {

/// Of a normally-closed one a pressed button, a broken wire and a pulled plug all read high.
class EstopContact final : public EstopInput {
 public:
  /// Without a pin it counts as closed: the parameter says that none is fitted.
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

  bool is_open() override {
    return pin_ >= 0 && gpio_get_level(static_cast<gpio_num_t>(pin_)) == level_;
  }

 private:
  int pin_ = -1;
  int level_ = 1;  ///< At which it is an e-stop.
};

}  // namespace wheelwire
