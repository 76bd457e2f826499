#include "analog_inputs.hpp"

namespace wheelwire {

bool AnalogInputs::start(const PeripheralList& list, Adc& adc) {
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

void AnalogInputs::measure() {
  for (size_t i = 0; i < count_; ++i) {
    uint16_t pin_mv = 0;
    if (inputs_[i].pin.measure(pin_mv)) inputs_[i].mailbox.post({.pin_mv = pin_mv});
  }
}

bool AnalogInputs::take(size_t channel, AnalogReading& out) {
  for (size_t i = 0; i < count_; ++i)
    if (inputs_[i].channel == channel) return inputs_[i].mailbox.take(out);
  return false;
}

}  // namespace wheelwire
