// The battery's voltage through a divider, on ADC1. Optional.
#pragma once

#include "board_rules.hpp"
#include "esp_adc/adc_cali.h"
#include "esp_adc/adc_oneshot.h"

namespace wheelwire {

class Battery {
 public:
  /// False where the board has none.
  bool start(const BoardDescription& board);
  /// 0 when it cannot be measured. Takes a fraction of a millisecond.
  uint16_t measure_millivolts();

 private:
  adc_oneshot_unit_handle_t unit_ = nullptr;
  adc_channel_t channel_{};
  adc_cali_handle_t calibration_ = nullptr;
  int divider_permille_ = 1000;
};

}  // namespace wheelwire
