#include "uart.hpp"

#include "check.hpp"

using namespace wheelwire::sim;

namespace {

Bytes all_bytes() {
  Bytes bytes;
  for (int value = 0; value < 256; ++value) bytes.push_back(static_cast<uint8_t>(value));
  return bytes;
}

}  // namespace

TEST(uart_at_equal_and_nearly_equal_rates_is_exact) {
  CHECK(resample(all_bytes(), 115200, 115200) == all_bytes());
  // A UART tolerates about 5 % over the ten bits of a byte.
  CHECK(resample(all_bytes(), 115200, 117000) == all_bytes());
  CHECK(resample(all_bytes(), 117000, 115200) == all_bytes());
}

TEST(uart_at_another_rate_garbles) {
  CHECK(resample(all_bytes(), 115200, 921600) != all_bytes());
  CHECK(resample(all_bytes(), 921600, 115200) != all_bytes());
  // Eight times too fast a receiver sees a start bit in nearly every low bit, a slow one merges
  // bytes.
  CHECK(resample(all_bytes(), 115200, 921600).size() > 256);
  CHECK(resample(all_bytes(), 921600, 115200).size() < 64);
}

TEST(uart_idle_line_brings_nothing) { CHECK(resample({}, 115200, 9600).empty()); }
