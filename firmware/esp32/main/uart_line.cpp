// The line on UART0.
#include "byte_queue.hpp"
#include "driver/uart.h"
#include "driver/uart_select.h"
#include "esp_attr.h"
#include "hal/uart_ll.h"
#include "line.hpp"
#include "sdkconfig.h"
#include "soc/uart_pins.h"

namespace wheelwire {
namespace {

constexpr uart_port_t kPort = UART_NUM_0;
constexpr uint32_t kBaudRate = CONFIG_WHEELWIRE_BAUD_RATE;
constexpr uint32_t kBitsPerByte = 10;
// Ten milliseconds at 2 Mbit/s: longer than any control step.
constexpr size_t kReceiveBuffer = 2048;
// A longer one would only keep stale frames waiting on a slow line.
constexpr size_t kSendBuffer = 1024;
// An interrupt after this many bytes, or after this many byte times of silence.
constexpr int kReceiveThreshold = 64;
constexpr uint8_t kReceiveTimeout = 2;

// Not the driver's own send buffer: it blocks when full, and does not say how full it is.
ByteQueue<kSendBuffer> to_send;

// Written once by UartLine::notify before the callback is set.
TaskHandle_t listener;
uint32_t listener_bits;

IRAM_ATTR void on_bytes(uart_port_t, uart_select_notif_t event, BaseType_t* woken) {
  if (event == UART_SELECT_READ_NOTIF) xTaskNotifyFromISR(listener, listener_bits, eSetBits, woken);
}

/// When its buffer is full, the driver's interrupt first notes that and then switches the receive
/// interrupts off; a read switches them on again. A read on the other core that comes between the
/// two leaves them off, and nothing would be received until a reset. Only while the buffer is
/// empty: then the driver has no other reason to keep them off.
void keep_receiving() {
  constexpr uint32_t kReceiveInterrupts = UART_INTR_RXFIFO_FULL | UART_INTR_RXFIFO_TOUT;
  const uint32_t enabled = uart_ll_get_intr_ena_status(UART_LL_GET_HW(kPort));
  if ((enabled & kReceiveInterrupts) != kReceiveInterrupts) uart_enable_rx_intr(kPort);
}

}  // namespace

bool UartLine::start() {
  uart_config_t config = {};
  config.baud_rate = kBaudRate;
  config.data_bits = UART_DATA_8_BITS;
  config.parity = UART_PARITY_DISABLE;
  config.stop_bits = UART_STOP_BITS_1;
  config.flow_ctrl = UART_HW_FLOWCTRL_DISABLE;
  config.source_clk = UART_SCLK_DEFAULT;
  return uart_driver_install(kPort, kReceiveBuffer, 0, 0, nullptr, ESP_INTR_FLAG_IRAM) == ESP_OK &&
         uart_param_config(kPort, &config) == ESP_OK &&
         uart_set_pin(kPort, U0TXD_GPIO_NUM, U0RXD_GPIO_NUM, UART_PIN_NO_CHANGE,
                      UART_PIN_NO_CHANGE) == ESP_OK &&
         uart_set_rx_full_threshold(kPort, kReceiveThreshold) == ESP_OK &&
         uart_set_rx_timeout(kPort, kReceiveTimeout) == ESP_OK;
}

void UartLine::notify(TaskHandle_t task, uint32_t bits) {
  listener = task;
  listener_bits = bits;
  uart_set_select_notif_callback(kPort, on_bytes);
}

size_t UartLine::read(uint8_t* out, size_t capacity) {
  const int size = uart_read_bytes(kPort, out, capacity, 0);
  if (size > 0) return static_cast<size_t>(size);
  keep_receiving();
  return 0;
}

bool UartLine::write(const uint8_t* data, size_t size) {
  if (!to_send.put(data, size)) return false;
  push();
  return true;
}

void UartLine::push() {
  while (to_send.front_size() > 0) {
    const int sent =
        uart_tx_chars(kPort, reinterpret_cast<const char*>(to_send.front()), to_send.front_size());
    if (sent <= 0) return;
    to_send.drop(static_cast<size_t>(sent));
  }
}

uint32_t UartLine::bytes_per_second() const { return kBaudRate / kBitsPerByte; }

}  // namespace wheelwire
