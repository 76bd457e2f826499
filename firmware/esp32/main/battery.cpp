#include "battery.hpp"

namespace wheelwire {

bool Battery::start(const BoardDescription& board, Adc& adc) {
  if (board.battery < 0) return false;
  divider_permille_ = board.battery_divider_permille;
  return pin_.start(adc, board.battery);
}

uint16_t Battery::measure_millivolts() {
  uint16_t pin_mv = 0;
  if (!pin_.measure(pin_mv)) return 0;
  return static_cast<uint16_t>(pin_mv * divider_permille_ / 1000);
}

}  // namespace wheelwire
