#pragma once

#include "esp_err.h"
#include "gpio_matrix.hpp"

using gpio_num_t = int;
enum gpio_mode_t { GPIO_MODE_INPUT, GPIO_MODE_OUTPUT };
enum gpio_pullup_t { GPIO_PULLUP_DISABLE, GPIO_PULLUP_ENABLE };
enum gpio_pulldown_t { GPIO_PULLDOWN_DISABLE, GPIO_PULLDOWN_ENABLE };
enum gpio_pull_mode_t { GPIO_PULLUP_ONLY, GPIO_FLOATING };
enum gpio_int_type_t { GPIO_INTR_DISABLE };

struct gpio_config_t {
  uint64_t pin_bit_mask;
  gpio_mode_t mode;
  gpio_pullup_t pull_up_en;
  gpio_pulldown_t pull_down_en;
  gpio_int_type_t intr_type;
};

/// The levels that an input shows when it is read, in order; the last one from then on.
inline std::vector<int> fake_samples{0};

inline esp_err_t gpio_config(const gpio_config_t* config) {
  for (int pin = 0; pin < 40; ++pin) {
    if (!(config->pin_bit_mask >> pin & 1)) continue;
    fake_matrix.enabled[pin] = config->mode == GPIO_MODE_OUTPUT;
    fake_matrix.pulled_up[pin] = config->pull_up_en == GPIO_PULLUP_ENABLE;
    fake_matrix.take_from_peripherals(pin);
  }
  return config->pin_bit_mask != 0 ? ESP_OK : ESP_FAIL;
}
inline esp_err_t gpio_set_pull_mode(gpio_num_t pin, gpio_pull_mode_t mode) {
  fake_matrix.pulled_up[pin] = mode == GPIO_PULLUP_ONLY;
  return ESP_OK;
}
inline int gpio_get_level(gpio_num_t) {
  const int level = fake_samples.front();
  if (fake_samples.size() > 1) fake_samples.erase(fake_samples.begin());
  return level;
}
inline esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level) {
  fake_matrix.levels[pin] = level != 0;
  fake_matrix.look();
  return ESP_OK;
}
