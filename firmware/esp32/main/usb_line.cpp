// The line on the chip's own USB.
#include "driver/usb_serial_jtag.h"
#include "driver/usb_serial_jtag_select.h"
#include "esp_attr.h"
#include "line.hpp"

namespace wheelwire {
namespace {

constexpr uint32_t kReceiveBuffer = 2048;
constexpr uint32_t kSendBuffer = 1024;

// Written once by UsbLine::notify before the callback is set.
TaskHandle_t listener;
uint32_t listener_bits;

void on_bytes(usj_select_notif_t event, BaseType_t* woken) {
  if (event == USJ_SELECT_READ_NOTIF) xTaskNotifyFromISR(listener, listener_bits, eSetBits, woken);
}

}  // namespace

bool UsbLine::start() {
  usb_serial_jtag_driver_config_t config = {
      .tx_buffer_size = kSendBuffer,
      .rx_buffer_size = kReceiveBuffer,
  };
  return usb_serial_jtag_driver_install(&config) == ESP_OK;
}

void UsbLine::notify(TaskHandle_t task, uint32_t bits) {
  listener = task;
  listener_bits = bits;
  usb_serial_jtag_set_select_notif_callback(on_bytes);
}

size_t UsbLine::read(uint8_t* out, size_t capacity) {
  const int size = usb_serial_jtag_read_bytes(out, capacity, 0);
  return size > 0 ? static_cast<size_t>(size) : 0;
}

bool UsbLine::write(const uint8_t* data, size_t size) {
  return usb_serial_jtag_write_bytes(data, size, 0) == static_cast<int>(size);
}

}  // namespace wheelwire
