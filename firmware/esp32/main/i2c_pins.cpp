#include "i2c_pins.hpp"

#include "board_rules.hpp"
#include "clock.hpp"
#include "driver/gpio.h"
#include "esp_rom_sys.h"

namespace wheelwire {
namespace {

constexpr gpio_num_t gpio(int pin) { return static_cast<gpio_num_t>(pin); }

}  // namespace

/// High before they are outputs: a low level on one of them would be a start.
bool I2cPins::start(int data, int clock) {
  data_ = data;
  clock_ = clock;
  set_data(true);
  set_clock(true);
  const gpio_config_t config = {
      .pin_bit_mask = mask_of(data) | mask_of(clock),
      .mode = GPIO_MODE_INPUT_OUTPUT_OD,
      .pull_up_en = GPIO_PULLUP_ENABLE,
      .pull_down_en = GPIO_PULLDOWN_DISABLE,
      .intr_type = GPIO_INTR_DISABLE,
  };
  return gpio_config(&config) == ESP_OK;
}

void I2cPins::set_clock(bool high) { gpio_set_level(gpio(clock_), high ? 1 : 0); }

void I2cPins::set_data(bool high) { gpio_set_level(gpio(data_), high ? 1 : 0); }

bool I2cPins::clock() { return gpio_get_level(gpio(clock_)) != 0; }

bool I2cPins::data() { return gpio_get_level(gpio(data_)) != 0; }

void I2cPins::wait() { esp_rom_delay_us(1); }

uint64_t I2cPins::now_us() { return wheelwire::now_us(); }

}  // namespace wheelwire
