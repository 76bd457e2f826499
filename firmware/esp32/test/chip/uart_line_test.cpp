// The line on UART0, on a driver that leaves its receive interrupts off.
#include "check.hpp"
#include "driver/uart.h"
#include "line.hpp"

using wheelwire::UartLine;

namespace {

constexpr uint32_t kReceive = UART_INTR_RXFIFO_FULL | UART_INTR_RXFIFO_TOUT;

UartLine started_line() {
  fake_uart = {};
  UartLine line;
  CHECK(line.start());
  return line;
}

}  // namespace

TEST(a_line_whose_driver_left_reception_off_receives_again) {
  for (const uint32_t lost : {kReceive, UART_INTR_RXFIFO_FULL, UART_INTR_RXFIFO_TOUT}) {
    UartLine line = started_line();
    fake_uart.enabled = UART_INTR_TXFIFO_EMPTY | (kReceive & ~lost);
    uint8_t byte = 0;
    CHECK(line.read(&byte, 1) == 0);
    CHECK(fake_uart.enabled == (UART_INTR_TXFIFO_EMPTY | kReceive));
    // Once: it forgets no interrupt that is pending.
    CHECK(line.read(&byte, 1) == 0 && fake_uart.switched_on == 1);
  }
}

TEST(a_line_leaves_reception_off_while_its_buffer_is_full) {
  UartLine line = started_line();
  fake_uart.received = {1, 2};
  fake_uart.enabled = 0;
  uint8_t byte = 0;
  CHECK(line.read(&byte, 1) == 1 && byte == 1);
  CHECK(fake_uart.switched_on == 0);
}
