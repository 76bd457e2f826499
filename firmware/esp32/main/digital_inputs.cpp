#include "digital_inputs.hpp"

#include "driver/gpio.h"
#include "esp_rom_sys.h"

namespace wheelwire {
namespace {

bool start_pin(const Peripheral& entry) {
  const auto is_set = [&entry](uint8_t flag) { return (entry.flags & flag) != 0; };
  const gpio_config_t config = {
      .pin_bit_mask = mask_of(entry.pin_a),
      .mode = GPIO_MODE_INPUT,
      .pull_up_en = is_set(peripheralflag::kPullUp) ? GPIO_PULLUP_ENABLE : GPIO_PULLUP_DISABLE,
      .pull_down_en =
          is_set(peripheralflag::kPullDown) ? GPIO_PULLDOWN_ENABLE : GPIO_PULLDOWN_DISABLE,
      .intr_type = GPIO_INTR_DISABLE,
  };
  return gpio_config(&config) == ESP_OK;
}

}  // namespace

bool DigitalInputs::start(const PeripheralList& list) {
  bool is_started = true;
  for (size_t i = 0; i < kMostPeripherals; ++i) {
    const bool is_input = i < list.count && is_digital_input(list.entries[i].kind);
    pins_[i] = is_input ? list.entries[i].pin_a : int8_t{-1};
    if (is_input) is_started = start_pin(list.entries[i]) && is_started;
  }
  // A pull-up charges its wire.
  esp_rom_delay_us(kApartUs);
  levels_ = sample();
  return is_started;
}

uint16_t DigitalInputs::levels() {
  const auto changed = static_cast<uint16_t>(sample() ^ levels_);
  if (changed == 0) return levels_;
  esp_rom_delay_us(kApartUs);
  levels_ = static_cast<uint16_t>(levels_ ^ (changed & (sample() ^ levels_)));
  return levels_;
}

uint16_t DigitalInputs::sample() const {
  uint16_t levels = 0;
  for (size_t i = 0; i < kMostPeripherals; ++i)
    if (pins_[i] >= 0 && gpio_get_level(static_cast<gpio_num_t>(pins_[i])) != 0)
      levels |= static_cast<uint16_t>(1u << i);
  return levels;
}

}  // namespace wheelwire
