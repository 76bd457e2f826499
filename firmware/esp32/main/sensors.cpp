#include "sensors.hpp"

#include "clock.hpp"
#include "freertos/task.h"

namespace wheelwire {
namespace {

constexpr BaseType_t kCore = 0;
/// Above housekeeping, which can wait.
constexpr UBaseType_t kPriority = tskIDLE_PRIORITY + 5;
constexpr uint32_t kStackBytes = 3072;

StackType_t stack[kStackBytes];
StaticTask_t task_memory;

}  // namespace

bool Sensors::start(const PeripheralList& list) {
  bool is_started = inputs_.start(list);
  for (size_t i = 0; i < list.count; ++i) {
    const Peripheral& entry = list.entries[i];
    if (is_on_bus(entry.kind)) is_started = start_chip(i, entry) && is_started;
    if (entry.kind == PeripheralKind::kRange) is_started = start_range(i, entry) && is_started;
  }
  if (bus_count_ != 0 || echo_count_ != 0)
    xTaskCreateStaticPinnedToCore(run, "sensors", kStackBytes, this, kPriority, stack, &task_memory,
                                  kCore);
  return is_started;
}

bool Sensors::start_chip(size_t channel, const Peripheral& entry) {
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

bool Sensors::start_range(size_t channel, const Peripheral& entry) {
  if (echo_count_ == 0 && !capture_.start()) return false;
  EchoPin& echo = echoes_[echo_count_];
  if (!echo.start(capture_, entry)) return false;
  ++echo_count_;
  ranges_.add(channel, entry, echo);
  return true;
}

Sensors::Bus* Sensors::bus_of(const Peripheral& entry) {
  for (size_t i = 0; i < bus_count_; ++i)
    if (buses_[i].pins.is_on(entry.pin_a, entry.pin_b)) return &buses_[i];
  Bus& bus = buses_[bus_count_];
  if (!bus.pins.start(entry.pin_a, entry.pin_b)) return nullptr;
  ++bus_count_;
  return &bus;
}

/// A delay, not a period: after a bus that hung the lower tasks get their turn first.
void Sensors::run(void* self) {
  auto& sensors = *static_cast<Sensors*>(self);
  for (;;) {
    sensors.sensors_.poll();
    sensors.ranges_.poll(now_us());
    vTaskDelay(pdMS_TO_TICKS(I2cSensors::kPollUs / 1000));
  }
}

}  // namespace wheelwire
