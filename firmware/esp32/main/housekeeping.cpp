#include "housekeeping.hpp"

#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "sensor_hub.hpp"
#include "status_led.hpp"
#include "task_watchdog.hpp"

namespace wheelwire {
namespace {

constexpr uint32_t kCycleMs = 20;
constexpr uint32_t kCyclesPerBattery = 2;
// A measurement that fails is 0 mV until the next one, and must not count as a broken wire.
static_assert(2 * kCyclesPerBattery * kCycleMs * 1000 < SensorHub::kZeroUs);
constexpr uint32_t kCyclesPerAnalog = SensorHub::kAnalogPeriodUs / 1000 / kCycleMs;

constexpr BaseType_t kCore = 0;
constexpr UBaseType_t kPriority = tskIDLE_PRIORITY + 1;
constexpr uint32_t kStackBytes = 3072;

StackType_t stack[kStackBytes];
StaticTask_t task_memory;

}  // namespace

void Housekeeping::start(bool has_battery, int led_pin) {
  has_battery_ = has_battery;
  led_pin_ = led_pin;
  start_status_led(led_pin);
  xTaskCreateStaticPinnedToCore(run, "housekeeping", kStackBytes, this, kPriority, stack,
                                &task_memory, kCore);
}

void Housekeeping::run(void* self) {
  watch_this_task();
  TickType_t wake = xTaskGetTickCount();
  for (;;) {
    static_cast<Housekeeping*>(self)->run_once();
    feed_task_watchdog();
    xTaskDelayUntil(&wake, pdMS_TO_TICKS(kCycleMs));
  }
}

void Housekeeping::run_once() {
  ++cycles_;
  show_on_status_led(led_pin_, state_.supervisor.load(std::memory_order_relaxed),
                     cycles_ * kCycleMs);
  if (has_battery_ && cycles_ % kCyclesPerBattery == 0)
    state_.battery_mv.store(battery_.measure_millivolts(), std::memory_order_relaxed);
  if (cycles_ % kCyclesPerAnalog == 0) analog_.measure();
}

}  // namespace wheelwire
