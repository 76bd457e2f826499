// ADC1, and the pins whose voltage it measures: one at a time, by housekeeping.
#pragma once

#include <stdint.h>

#include "esp_adc/adc_cali.h"
#include "esp_adc/adc_oneshot.h"

namespace wheelwire {

class Adc {
 public:
  /// Takes the unit. May be called again: there is one.
  bool start();
  adc_oneshot_unit_handle_t unit() const { return unit_; }

 private:
  adc_oneshot_unit_handle_t unit_ = nullptr;
};

class AdcPin {
 public:
  /// Starts the unit if it was not.
  bool start(Adc& adc, int pin);
  /// Up to about 3100 mV; false if it cannot be measured. Takes a fraction of a millisecond.
  bool measure(uint16_t& millivolts) const;

 private:
  adc_oneshot_unit_handle_t unit_ = nullptr;
  adc_channel_t channel_{};
  adc_cali_handle_t calibration_ = nullptr;
};

}  // namespace wheelwire
