#include "adc.hpp"

#include "esp_adc/adc_cali_scheme.h"

namespace wheelwire {
namespace {

constexpr adc_atten_t kAttenuation = ADC_ATTEN_DB_12;  // To about 3.1 V at the pin.
constexpr adc_bitwidth_t kBits = ADC_BITWIDTH_DEFAULT;
constexpr int kSamples = 16;

/// Uses the chip's factory calibration; the scheme depends on the family.
bool create_calibration([[maybe_unused]] adc_channel_t channel, adc_cali_handle_t& calibration) {
#if ADC_CALI_SCHEME_CURVE_FITTING_SUPPORTED
  const adc_cali_curve_fitting_config_t config = {
      .unit_id = ADC_UNIT_1, .chan = channel, .atten = kAttenuation, .bitwidth = kBits};
  return adc_cali_create_scheme_curve_fitting(&config, &calibration) == ESP_OK;
#else
  adc_cali_line_fitting_config_t config = {};
  config.unit_id = ADC_UNIT_1;
  config.atten = kAttenuation;
  config.bitwidth = kBits;
  config.default_vref = 1100;  // Nominal, for the few chips without a calibrated value.
  return adc_cali_create_scheme_line_fitting(&config, &calibration) == ESP_OK;
#endif
}

}  // namespace

bool Adc::start() {
  if (unit_ != nullptr) return true;
  const adc_oneshot_unit_init_cfg_t config = {
      .unit_id = ADC_UNIT_1, .clk_src = {}, .ulp_mode = ADC_ULP_MODE_DISABLE};
  return adc_oneshot_new_unit(&config, &unit_) == ESP_OK;
}

bool AdcPin::start(Adc& adc, int pin) {
  adc_unit_t unit{};
  const adc_oneshot_chan_cfg_t config = {.atten = kAttenuation, .bitwidth = kBits};
  if (adc_oneshot_io_to_channel(pin, &unit, &channel_) != ESP_OK || unit != ADC_UNIT_1)
    return false;
  if (!adc.start()) return false;
  unit_ = adc.unit();
  return adc_oneshot_config_channel(unit_, channel_, &config) == ESP_OK &&
         create_calibration(channel_, calibration_);
}

bool AdcPin::measure(uint16_t& millivolts) const {
  int sum_mv = 0;
  for (int i = 0; i < kSamples; ++i) {
    int pin_mv = 0;
    if (adc_oneshot_get_calibrated_result(unit_, calibration_, channel_, &pin_mv) != ESP_OK)
      return false;
    sum_mv += pin_mv;
  }
  millivolts = static_cast<uint16_t>(sum_mv / kSamples);
  return true;
}

}  // namespace wheelwire
