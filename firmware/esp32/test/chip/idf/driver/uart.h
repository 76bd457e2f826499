// UART0, with the receive interrupts that a test switches off.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include <vector>

#include "esp_err.h"
#include "freertos/FreeRTOS.h"

enum uart_port_t { UART_NUM_0 };
enum uart_option_t {
  UART_DATA_8_BITS,
  UART_PARITY_DISABLE,
  UART_STOP_BITS_1,
  UART_HW_FLOWCTRL_DISABLE,
  UART_SCLK_DEFAULT,
};
struct uart_config_t {
  uint32_t baud_rate;
  uart_option_t data_bits, parity, stop_bits, flow_ctrl, source_clk;
};

constexpr int ESP_INTR_FLAG_IRAM = 1;
constexpr int UART_PIN_NO_CHANGE = -1;
constexpr uint32_t UART_INTR_RXFIFO_FULL = 1;
constexpr uint32_t UART_INTR_TXFIFO_EMPTY = 1 << 1;
constexpr uint32_t UART_INTR_RXFIFO_TOUT = 1 << 8;

struct FakeUart {
  std::vector<uint8_t> received;  ///< What the driver's buffer holds.
  std::vector<uint8_t> sent;
  uint32_t enabled = 0;
  /// How often its receive interrupts were switched on, which drops pending ones.
  int switched_on = 0;
};
inline FakeUart fake_uart;

inline esp_err_t uart_driver_install(uart_port_t, int, int, int, void*, int) {
  fake_uart.enabled = UART_INTR_RXFIFO_FULL | UART_INTR_RXFIFO_TOUT;
  return ESP_OK;
}
inline esp_err_t uart_param_config(uart_port_t, const uart_config_t*) { return ESP_OK; }
inline esp_err_t uart_set_pin(uart_port_t, int, int, int, int) { return ESP_OK; }
inline esp_err_t uart_set_rx_full_threshold(uart_port_t, int) { return ESP_OK; }
inline esp_err_t uart_set_rx_timeout(uart_port_t, uint8_t) { return ESP_OK; }
inline esp_err_t uart_enable_rx_intr(uart_port_t) {
  fake_uart.enabled |= UART_INTR_RXFIFO_FULL | UART_INTR_RXFIFO_TOUT;
  ++fake_uart.switched_on;
  return ESP_OK;
}
inline int uart_read_bytes(uart_port_t, void* out, size_t length, TickType_t) {
  auto& bytes = fake_uart.received;
  const size_t size = bytes.size() < length ? bytes.size() : length;
  for (size_t i = 0; i < size; ++i) static_cast<uint8_t*>(out)[i] = bytes[i];
  bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
  return static_cast<int>(size);
}
inline int uart_tx_chars(uart_port_t, const char* bytes, size_t length) {
  fake_uart.sent.insert(fake_uart.sent.end(), bytes, bytes + length);
  return static_cast<int>(length);
}
