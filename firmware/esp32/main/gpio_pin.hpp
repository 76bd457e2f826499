// Single pins of the chip as an output or an input.
#pragma once

#include "board_rules.hpp"
#include "driver/gpio.h"
#include "image_board.hpp"

namespace wheelwire {

/// Low from its first moment as an output.
inline bool make_low_output(int pin) {
  gpio_set_level(static_cast<gpio_num_t>(pin), 0);
  const gpio_config_t config = {
      .pin_bit_mask = mask_of(pin),
      .mode = GPIO_MODE_OUTPUT,
      .pull_up_en = GPIO_PULLUP_DISABLE,
      .pull_down_en = GPIO_PULLDOWN_DISABLE,
      .intr_type = GPIO_INTR_DISABLE,
  };
  return gpio_config(&config) == ESP_OK;
}

/// Whether the chip has pull resistors at a pin.
inline bool can_pull(int pin) {
  return (table_of(kImageBoard.chip)->input_only & mask_of(pin)) == 0;
}

/// For an output of a sensor. Without its wire the pin would see the edges of the motors: where the
/// chip can, it pulls it down.
inline bool make_sensor_input(int pin, gpio_int_type_t interrupt = GPIO_INTR_DISABLE) {
  const gpio_config_t config = {
      .pin_bit_mask = mask_of(pin),
      .mode = GPIO_MODE_INPUT,
      .pull_up_en = GPIO_PULLUP_DISABLE,
      .pull_down_en = can_pull(pin) ? GPIO_PULLDOWN_ENABLE : GPIO_PULLDOWN_DISABLE,
      .intr_type = interrupt,
  };
  return gpio_config(&config) == ESP_OK;
}

}  // namespace wheelwire
