// The board's peripherals on this chip, and the task that reads those on an I2C bus and fires range
// sensors. It runs on the other core, if there is one, and at a lower priority than the control
// task: a hung bus does not delay control steps.
#pragma once

#include "adc.hpp"
#include "clock.hpp"
#include "data_ready_pin.hpp"
#include "digital_inputs.hpp"
#include "echo_pin.hpp"
#include "freertos/task.h"
#include "i2c_pins.hpp"
#include "i2c_sensors.hpp"
#include "range_finder.hpp"
#include "sensor_port.hpp"

namespace wheelwire {

class Sensors final : public SensorPort {
 public:
  /// Sets up the pins, and creates the task if it has something to do. It does as much as it can;
  /// false: a pin could not be set up.
  bool start(const PeripheralList& list) {
    bool is_started = inputs_.start(list);
    for (size_t i = 0; i < list.count; ++i) {
      const Peripheral& entry = list.entries[i];
      if (is_on_bus(entry.kind)) is_started = start_chip(i, entry) && is_started;
      if (entry.kind == PeripheralKind::kRange) is_started = start_range(i, entry) && is_started;
    }
    if (bus_count_ != 0 || echo_count_ != 0)
      xTaskCreateStaticPinnedToCore(run, "sensors", kStackBytes, this, kPriority, stack_,
                                    &task_memory_, kCore);
    return is_started;
  }
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
  static constexpr BaseType_t kCore = 0;
  /// Above housekeeping, which can wait.
  static constexpr UBaseType_t kPriority = tskIDLE_PRIORITY + 5;
  static constexpr uint32_t kStackBytes = 3072;

  struct Bus {
    I2cPins pins;
    SoftI2c i2c{pins};
  };

  /// A delay, not a period: after a bus that hung the lower tasks get their turn first.
  [[noreturn]] static void run(void* self) {
    auto& sensors = *static_cast<Sensors*>(self);
    for (;;) {
      sensors.sensors_.poll();
      sensors.ranges_.poll(now_us());
      vTaskDelay(pdMS_TO_TICKS(I2cSensors::kPollUs / 1000));
    }
  }
  bool start_chip(size_t channel, const Peripheral& entry) {
    Bus* const bus = bus_of(entry);
    if (bus == nullptr) return false;
    DataReadyPin* ready = nullptr;
    if (entry.kind == PeripheralKind::kImu && entry.pin_c >= 0) {
      has_interrupts_ = has_interrupts_ || DataReadyPin::start_interrupts();
      ready = &ready_[channel];
      if (!has_interrupts_ || !ready->start(entry.pin_c)) return false;
    }
    sensors_.add(channel, entry, bus->i2c, ready);
    return true;
  }
  bool start_range(size_t channel, const Peripheral& entry) {
    if (echo_count_ == 0 && !capture_.start()) return false;
    EchoPin& echo = echoes_[echo_count_];
    if (!echo.start(capture_, entry)) return false;
    ++echo_count_;
    ranges_.add(channel, entry, echo);
    return true;
  }
  /// nullptr: its pins could not be set up.
  Sensors::Bus* bus_of(const Peripheral& entry) {
    for (size_t i = 0; i < bus_count_; ++i)
      if (buses_[i].pins.is_on(entry.pin_a, entry.pin_b)) return &buses_[i];
    Bus& bus = buses_[bus_count_];
    if (!bus.pins.start(entry.pin_a, entry.pin_b)) return nullptr;
    ++bus_count_;
    return &bus;
  }

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
  StackType_t stack_[kStackBytes];
  StaticTask_t task_memory_;
};

}  // namespace wheelwire
