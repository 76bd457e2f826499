// The emergency-stop contact: normally closed to ground, against a pull-up.
#pragma once

#include "board/board.hpp"
#include "driver/gpio.h"
#include "hal.hpp"

namespace wheelwire {

/// A pressed button, a broken wire and a pulled plug all read high.
class EstopContact final : public EstopInput {
 public:
  bool start() {
    const gpio_config_t config = {
        .pin_bit_mask = mask_of(kPins.estop),
        .mode = GPIO_MODE_INPUT,
        .pull_up_en = GPIO_PULLUP_ENABLE,
        .pull_down_en = GPIO_PULLDOWN_DISABLE,
        .intr_type = GPIO_INTR_DISABLE,
    };
    return gpio_config(&config) == ESP_OK;
  }

  bool is_open() override { return gpio_get_level(static_cast<gpio_num_t>(kPins.estop)) != 0; }
};

}  // namespace wheelwire
