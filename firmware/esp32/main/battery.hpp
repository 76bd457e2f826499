// The battery's voltage through a divider, on ADC1. Optional.
#pragma once

#include "adc.hpp"
#include "board_rules.hpp"

namespace wheelwire {

class Battery {
 public:
  /// False where the board has none.
  bool start(const BoardDescription& board, Adc& adc);
  /// 0 when it cannot be measured. Takes a fraction of a millisecond.
  uint16_t measure_millivolts();

 private:
  AdcPin pin_;
  int divider_permille_ = 1000;
};

}  // namespace wheelwire
