// ADC1, the pins whose voltage it measures, and what is connected to them: the battery and the
// board's analogue inputs. Housekeeping measures one at a time.
#pragma once

#include <stdint.h>

#include "board_rules.hpp"
#include "esp_adc/adc_cali.h"
#include "esp_adc/adc_cali_scheme.h"
#include "esp_adc/adc_oneshot.h"
#include "mailbox.hpp"
#include "peripherals.hpp"
#include "sensor_port.hpp"

namespace wheelwire {

class Adc {
 public:
  /// Takes the unit. May be called again: there is one.
  bool start() {
    if (unit_ != nullptr) return true;
    const adc_oneshot_unit_init_cfg_t config = {
        .unit_id = ADC_UNIT_1, .clk_src = {}, .ulp_mode = ADC_ULP_MODE_DISABLE};
    return adc_oneshot_new_unit(&config, &unit_) == ESP_OK;
  }
  adc_oneshot_unit_handle_t unit() const { return unit_; }

 private:
  adc_oneshot_unit_handle_t unit_ = nullptr;
};

class AdcPin {
 public:
  /// Starts the unit if it was not.
  bool start(Adc& adc, int pin) {
    adc_unit_t unit{};
    const adc_oneshot_chan_cfg_t config = {.atten = kAttenuation, .bitwidth = kBits};
    if (adc_oneshot_io_to_channel(pin, &unit, &channel_) != ESP_OK || unit != ADC_UNIT_1)
      return false;
    if (!adc.start()) return false;
    unit_ = adc.unit();
    return adc_oneshot_config_channel(unit_, channel_, &config) == ESP_OK && create_calibration();
  }
  /// Up to about 3100 mV; false if it cannot be measured. Takes a fraction of a millisecond.
  bool measure(uint16_t& millivolts) const {
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

 private:
  static constexpr adc_atten_t kAttenuation = ADC_ATTEN_DB_12;  // To about 3.1 V at the pin.
  static constexpr adc_bitwidth_t kBits = ADC_BITWIDTH_DEFAULT;
  static constexpr int kSamples = 16;

  /// Uses the chip's factory calibration; the scheme depends on the family.
  bool create_calibration() {
#if ADC_CALI_SCHEME_CURVE_FITTING_SUPPORTED
    const adc_cali_curve_fitting_config_t config = {
        .unit_id = ADC_UNIT_1, .chan = channel_, .atten = kAttenuation, .bitwidth = kBits};
    return adc_cali_create_scheme_curve_fitting(&config, &calibration_) == ESP_OK;
#else
    adc_cali_line_fitting_config_t config = {};
    config.unit_id = ADC_UNIT_1;
    config.atten = kAttenuation;
    config.bitwidth = kBits;
    config.default_vref = 1100;  // Nominal, for the few chips without a calibrated value.
    return adc_cali_create_scheme_line_fitting(&config, &calibration_) == ESP_OK;
#endif
  }

  adc_oneshot_unit_handle_t unit_ = nullptr;
  adc_channel_t channel_{};
  adc_cali_handle_t calibration_ = nullptr;
};

/// The battery's voltage through a divider. Optional.
class Battery {
 public:
  /// False where the board has none.
  bool start(const BoardDescription& board, Adc& adc) {
    divider_permille_ = board.battery_divider_permille;
    return board.battery >= 0 && pin_.start(adc, board.battery);
  }
  /// 0 when it cannot be measured. Takes a fraction of a millisecond.
  uint16_t measure_millivolts() {
    uint16_t pin_mv = 0;
    if (!pin_.measure(pin_mv)) return 0;
    return static_cast<uint16_t>(pin_mv * divider_permille_ / 1000);
  }

 private:
  AdcPin pin_;
  int divider_permille_ = 1000;
};

/// Analogue inputs of the board's peripherals: taken by the control task.
class AnalogInputs {
 public:
  /// Does as much as it can; false: one cannot be measured.
  bool start(const PeripheralList& list, Adc& adc) {
    bool is_started = true;
    for (size_t i = 0; i < list.count && count_ < kMostAnalog; ++i) {
      if (list.entries[i].kind != PeripheralKind::kAnalog) continue;
      Input& input = inputs_[count_];
      input.channel = i;
      if (input.pin.start(adc, list.entries[i].pin_a)) {
        ++count_;
      } else {
        is_started = false;
      }
    }
    return is_started;
  }
  /// All of them. One that fails has no reading.
  void measure() {
    for (size_t i = 0; i < count_; ++i) {
      uint16_t pin_mv = 0;
      if (inputs_[i].pin.measure(pin_mv)) inputs_[i].mailbox.post({.pin_mv = pin_mv});
    }
  }
  /// From the control task.
  bool take(size_t channel, AnalogReading& out) {
    for (size_t i = 0; i < count_; ++i)
      if (inputs_[i].channel == channel) return inputs_[i].mailbox.take(out);
    return false;
  }

 private:
  struct Input {
    size_t channel = 0;
    AdcPin pin;
    Mailbox<AnalogReading> mailbox;
  };

  Input inputs_[kMostAnalog];
  size_t count_ = 0;
};

}  // namespace wheelwire
