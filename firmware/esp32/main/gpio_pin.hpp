// Single pins of the chip as an output or an input.
#pragma once

#include "board_rules.hpp"
#include "driver/gpio.h"
#include "image_board.hpp"

namespace wheelwire {

/// Which of its pull resistors the chip switches on.
struct Pulls {
  bool up = false;
  bool down = false;
};

inline bool configure(PinMask pins, gpio_mode_t mode, Pulls pulls = {},
                      gpio_int_type_t interrupt = GPIO_INTR_DISABLE) {
  const gpio_config_t config = {
      .pin_bit_mask = pins,
      .mode = mode,
      .pull_up_en = pulls.up ? GPIO_PULLUP_ENABLE : GPIO_PULLUP_DISABLE,
      .pull_down_en = pulls.down ? GPIO_PULLDOWN_ENABLE : GPIO_PULLDOWN_DISABLE,
      .intr_type = interrupt,
  };
  return gpio_config(&config) == ESP_OK;
}

inline void set_level(int pin, bool high) { gpio_set_level(static_cast<gpio_num_t>(pin), high); }
inline bool is_high(int pin) { return gpio_get_level(static_cast<gpio_num_t>(pin)) != 0; }

/// Low from its first moment as an output.
inline bool make_low_output(int pin) {
  set_level(pin, false);
  return configure(mask_of(pin), GPIO_MODE_OUTPUT);
}

/// Whether the chip has pull resistors at a pin.
inline bool can_pull(int pin) {
  return (table_of(kImageBoard.chip)->input_only & mask_of(pin)) == 0;
}

/// For an output of a sensor. Without its wire the pin would see the edges of the motors: where the
/// chip can, it pulls it down.
inline bool make_sensor_input(int pin, gpio_int_type_t interrupt = GPIO_INTR_DISABLE) {
  return configure(mask_of(pin), GPIO_MODE_INPUT, {.down = can_pull(pin)}, interrupt);
}

}  // namespace wheelwire
