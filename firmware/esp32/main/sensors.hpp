// The board's peripherals on this chip, and the task that reads those on an I2C bus and fires range
// sensors. It runs on the other core, if there is one, and at a lower priority than the control
// task: a hung bus does not delay control steps.
#pragma once

#include "analog_inputs.hpp"
#include "data_ready_pin.hpp"
#include "digital_inputs.hpp"
#include "echo_pin.hpp"
#include "i2c_pins.hpp"
#include "i2c_sensors.hpp"
#include "range_finder.hpp"
#include "sensor_port.hpp"

namespace wheelwire {

class Sensors final : public SensorPort {
 public:
  /// Sets up the pins, and creates the task if it has something to do. It does as much as it can;
  /// false: a pin could not be set up.
  bool start(const PeripheralList& list);
  /// Separate, because before this the ADC provides the chip's entropy.
  bool start_analog(const PeripheralList& list, Adc& adc) { return analog_.start(list, adc); }
  /// For housekeeping to measure.
  AnalogInputs& analog() { return analog_; }

  uint16_t levels() override { return inputs_.levels(); }
  bool take(size_t channel, ImuReading& out) override { return sensors_.take(channel, out); }
  bool take(size_t channel, PowerReading& out) override { return sensors_.take(channel, out); }
  bool take(size_t channel, RangeReading& out) override { return ranges_.take(channel, out); }
  bool take(size_t channel, AnalogReading& out) override { return analog_.take(channel, out); }

 private:
  struct Bus {
    I2cPins pins;
    SoftI2c i2c{pins};
  };

  [[noreturn]] static void run(void* self);
  bool start_chip(size_t channel, const Peripheral& entry);
  bool start_range(size_t channel, const Peripheral& entry);
  /// nullptr: its pins could not be set up.
  Bus* bus_of(const Peripheral& entry);

  DigitalInputs inputs_;
  Bus buses_[kMostPeripherals];
  size_t bus_count_ = 0;
  DataReadyPin ready_[kMostPeripherals];
  bool has_interrupts_ = false;
  I2cSensors sensors_;
  CaptureTimer capture_;
  EchoPin echoes_[kMostRanges];
  size_t echo_count_ = 0;
  RangeFinder ranges_;
  AnalogInputs analog_;
};

}  // namespace wheelwire
