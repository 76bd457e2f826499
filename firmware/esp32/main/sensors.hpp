// The board's peripherals on this chip, and the task that reads those on an I2C bus. It has the
// other core, where there is one, and a priority below that of the control task: a bus that hangs
// delays no control step.
#pragma once

#include "data_ready_pin.hpp"
#include "digital_inputs.hpp"
#include "i2c_pins.hpp"
#include "i2c_sensors.hpp"
#include "sensor_port.hpp"

namespace wheelwire {

class Sensors final : public SensorPort {
 public:
  /// Sets up the pins, and creates the task if something is on a bus. It does as much as it can;
  /// false: a pin could not be set up.
  bool start(const PeripheralList& list);

  uint16_t levels() override { return inputs_.levels(); }
  bool take(size_t channel, ImuReading& out) override { return sensors_.take(channel, out); }
  bool take(size_t channel, PowerReading& out) override { return sensors_.take(channel, out); }

 private:
  struct Bus {
    I2cPins pins;
    SoftI2c i2c{pins};
  };

  [[noreturn]] static void run(void* self);
  bool start_chip(size_t channel, const Peripheral& entry);
  /// nullptr: its pins could not be set up.
  Bus* bus_of(const Peripheral& entry);

  DigitalInputs inputs_;
  Bus buses_[kMostPeripherals];
  size_t bus_count_ = 0;
  DataReadyPin ready_[kMostPeripherals];
  bool has_interrupts_ = false;
  I2cSensors sensors_;
};

}  // namespace wheelwire
