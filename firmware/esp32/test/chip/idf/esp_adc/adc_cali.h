// Stand-in for ESP-IDF's header of this name.
#pragma once

#include "esp_adc/adc_oneshot.h"

using adc_cali_handle_t = int*;

inline esp_err_t adc_oneshot_get_calibrated_result(adc_oneshot_unit_handle_t unit,
                                                   adc_cali_handle_t, adc_channel_t channel,
                                                   int* millivolts) {
  ++fake_adc.reads;
  *millivolts = fake_adc.millivolts[channel];
  return unit == nullptr || fake_adc.fails ? ESP_FAIL : ESP_OK;
}
