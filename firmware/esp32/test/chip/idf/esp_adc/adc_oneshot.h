// ADC1 of an ESP32: its channels by their pins, each with a voltage that a test sets.
#pragma once

#include <stdint.h>

#include <map>

#include "esp_err.h"

using adc_oneshot_unit_handle_t = int*;
enum adc_unit_t { ADC_UNIT_1, ADC_UNIT_2 };
enum adc_channel_t : int { ADC_CHANNEL_0 };
enum adc_atten_t { ADC_ATTEN_DB_12 };
enum adc_bitwidth_t { ADC_BITWIDTH_DEFAULT };
enum adc_clock_t { ADC_RTC_CLK_SRC_DEFAULT };
enum adc_ulp_mode_t { ADC_ULP_MODE_DISABLE };

struct adc_oneshot_unit_init_cfg_t {
  adc_unit_t unit_id;
  adc_clock_t clk_src;
  adc_ulp_mode_t ulp_mode;
};
struct adc_oneshot_chan_cfg_t {
  adc_atten_t atten;
  adc_bitwidth_t bitwidth;
};

struct FakeAdc {
  int units = 0;
  std::map<int, int> millivolts;  // By pin.
  bool fails = false;
  int reads = 0;
};
inline FakeAdc fake_adc;

inline esp_err_t adc_oneshot_io_to_channel(int pin, adc_unit_t* unit, adc_channel_t* channel) {
  *unit = pin >= 32 ? ADC_UNIT_1 : ADC_UNIT_2;
  *channel = static_cast<adc_channel_t>(pin);
  return ESP_OK;
}
/// A unit can be taken once.
inline esp_err_t adc_oneshot_new_unit(const adc_oneshot_unit_init_cfg_t*,
                                      adc_oneshot_unit_handle_t* unit) {
  *unit = &fake_adc.units;
  return ++fake_adc.units == 1 ? ESP_OK : ESP_FAIL;
}
inline esp_err_t adc_oneshot_config_channel(adc_oneshot_unit_handle_t unit, adc_channel_t,
                                            const adc_oneshot_chan_cfg_t*) {
  return unit == &fake_adc.units ? ESP_OK : ESP_FAIL;
}
