// The battery's voltage through a divider, on ADC1. Optional.
#pragma once

#include "esp_adc/adc_cali.h"
#include "esp_adc/adc_oneshot.h"
#include "sdkconfig.h"

namespace wheelwire {

class Battery {
 public:
#if CONFIG_WHEELWIRE_BATTERY
  static constexpr bool kFitted = true;
#else
  static constexpr bool kFitted = false;
#endif

  bool start();
  /// 0 when it cannot be measured. Takes a fraction of a millisecond.
  uint16_t measure_millivolts();

 private:
  adc_oneshot_unit_handle_t unit_ = nullptr;
  adc_channel_t channel_{};
  adc_cali_handle_t calibration_ = nullptr;
};

}  // namespace wheelwire
