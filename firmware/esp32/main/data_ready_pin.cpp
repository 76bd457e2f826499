#include "data_ready_pin.hpp"

#include "board_rules.hpp"
#include "clock.hpp"
#include "driver/gpio.h"
#include "esp_attr.h"
#include "esp_intr_alloc.h"
#include "image_board.hpp"

namespace wheelwire {

bool DataReadyPin::start_interrupts() {
  return gpio_install_isr_service(ESP_INTR_FLAG_IRAM) == ESP_OK;
}

/// A pin without a wire would see the edges of the motors: where the chip can, it pulls it down.
bool DataReadyPin::start(int pin) {
  const bool can_pull = (table_of(kImageBoard.chip)->input_only & mask_of(pin)) == 0;
  const gpio_config_t config = {
      .pin_bit_mask = mask_of(pin),
      .mode = GPIO_MODE_INPUT,
      .pull_up_en = GPIO_PULLUP_DISABLE,
      .pull_down_en = can_pull ? GPIO_PULLDOWN_ENABLE : GPIO_PULLDOWN_DISABLE,
      .intr_type = GPIO_INTR_POSEDGE,
  };
  return gpio_config(&config) == ESP_OK &&
         gpio_isr_handler_add(static_cast<gpio_num_t>(pin), on_edge, this) == ESP_OK;
}

IRAM_ATTR void DataReadyPin::on_edge(void* self) {
  auto& pin = *static_cast<DataReadyPin*>(self);
  portENTER_CRITICAL_ISR(&pin.lock_);
  pin.edge_us_ = static_cast<uint64_t>(esp_timer_get_time());
  portEXIT_CRITICAL_ISR(&pin.lock_);
}

uint64_t DataReadyPin::edge_us() {
  portENTER_CRITICAL(&lock_);
  const uint64_t edge_us = edge_us_;
  portEXIT_CRITICAL(&lock_);
  return edge_us;
}

}  // namespace wheelwire
