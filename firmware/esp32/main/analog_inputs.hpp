// Analogue inputs of the board's peripherals: measured by housekeeping, taken by the control task.
#pragma once

#include "adc.hpp"
#include "mailbox.hpp"
#include "peripherals.hpp"
#include "sensor_port.hpp"

namespace wheelwire {

class AnalogInputs {
 public:
  /// Does as much as it can; false: one cannot be measured.
  bool start(const PeripheralList& list, Adc& adc);
  /// All of them. One that fails has no reading.
  void measure();
  /// From the control task.
  bool take(size_t channel, AnalogReading& out);

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
