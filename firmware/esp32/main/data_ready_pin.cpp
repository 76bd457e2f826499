#include "data_ready_pin.hpp"

#include "clock.hpp"
#include "esp_attr.h"
#include "esp_intr_alloc.h"
#include "gpio_pin.hpp"

namespace wheelwire {

bool DataReadyPin::start_interrupts() {
  return gpio_install_isr_service(ESP_INTR_FLAG_IRAM) == ESP_OK;
}

bool DataReadyPin::start(int pin) {
  return make_sensor_input(pin, GPIO_INTR_POSEDGE) &&
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
