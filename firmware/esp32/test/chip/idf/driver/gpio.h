#pragma once

#include <functional>

#include "esp_err.h"
#include "gpio_matrix.hpp"

using gpio_num_t = int;
enum gpio_mode_t { GPIO_MODE_INPUT, GPIO_MODE_OUTPUT, GPIO_MODE_INPUT_OUTPUT_OD };
enum gpio_pullup_t { GPIO_PULLUP_DISABLE, GPIO_PULLUP_ENABLE };
enum gpio_pulldown_t { GPIO_PULLDOWN_DISABLE, GPIO_PULLDOWN_ENABLE };
enum gpio_pull_mode_t { GPIO_PULLUP_ONLY, GPIO_FLOATING };
enum gpio_int_type_t { GPIO_INTR_DISABLE, GPIO_INTR_POSEDGE };

struct gpio_config_t {
  uint64_t pin_bit_mask;
  gpio_mode_t mode;
  gpio_pullup_t pull_up_en;
  gpio_pulldown_t pull_down_en;
  gpio_int_type_t intr_type;
};

/// The levels that an input shows when it is read, in order; the last one from then on.
inline std::vector<int> fake_samples{0};
/// In their place where each pin has a level of its own.
inline std::function<int(gpio_num_t)> fake_level;
/// Called when an output's level is set.
inline std::function<void(gpio_num_t)> fake_on_set;

/// What becomes of each configuration.
inline esp_err_t fake_gpio_result = ESP_OK;

/// What serves the interrupt of each pin.
struct FakeGpioInterrupt {
  void (*handler)(void*);
  void* context;
};
inline std::map<gpio_num_t, FakeGpioInterrupt> fake_gpio_interrupts;
inline int fake_isr_services = 0;

inline esp_err_t gpio_config(const gpio_config_t* config) {
  for (int pin = 0; pin < 40; ++pin) {
    if (!(config->pin_bit_mask >> pin & 1)) continue;
    fake_matrix.enabled[pin] = config->mode == GPIO_MODE_OUTPUT;
    fake_matrix.open_drain[pin] = config->mode == GPIO_MODE_INPUT_OUTPUT_OD;
    fake_matrix.pulled_up[pin] = config->pull_up_en == GPIO_PULLUP_ENABLE;
    fake_matrix.pulled_down[pin] = config->pull_down_en == GPIO_PULLDOWN_ENABLE;
    fake_matrix.interrupts[pin] = config->intr_type == GPIO_INTR_POSEDGE;
    // An input keeps what drove the pin before.
    if (config->mode != GPIO_MODE_INPUT) fake_matrix.take_from_peripherals(pin);
    fake_matrix.look();
  }
  return config->pin_bit_mask != 0 ? fake_gpio_result : ESP_FAIL;
}
inline esp_err_t gpio_set_pull_mode(gpio_num_t pin, gpio_pull_mode_t mode) {
  fake_matrix.pulled_up[pin] = mode == GPIO_PULLUP_ONLY;
  return ESP_OK;
}
inline esp_err_t gpio_install_isr_service(int) {
  return ++fake_isr_services == 1 ? ESP_OK : ESP_FAIL;
}
inline esp_err_t gpio_isr_handler_add(gpio_num_t pin, void (*handler)(void*), void* context) {
  fake_gpio_interrupts[pin] = {handler, context};
  return ESP_OK;
}
inline int gpio_get_level(gpio_num_t pin) {
  if (fake_level) return fake_level(pin);
  const int level = fake_samples.front();
  if (fake_samples.size() > 1) fake_samples.erase(fake_samples.begin());
  return level;
}
inline esp_err_t gpio_set_level(gpio_num_t pin, uint32_t level) {
  fake_matrix.levels[pin] = level != 0;
  fake_matrix.look();
  if (fake_on_set) fake_on_set(pin);
  return ESP_OK;
}
