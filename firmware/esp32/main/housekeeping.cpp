#include "housekeeping.hpp"

#include <atomic>
#include <initializer_list>

#include "esp_system.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "gpio_pin.hpp"
#include "sensor_hub.hpp"
#include "task_watchdog.hpp"

namespace wheelwire {
namespace {

constexpr uint32_t kCycleMs = 20;
constexpr uint32_t kCyclesPerBattery = 2;
// A failed measurement reads 0 mV until the next one, and must not count as a broken wire.
static_assert(2 * kCyclesPerBattery * kCycleMs * 1000 < SensorHub::kZeroUs);
constexpr uint32_t kCyclesPerAnalog = SensorHub::kAnalogPeriodUs / 1000 / kCycleMs;
constexpr uint32_t kCyclesPerMemory = 1000 / kCycleMs;

constexpr BaseType_t kCore = 0;
constexpr UBaseType_t kPriority = tskIDLE_PRIORITY + 1;
constexpr uint32_t kStackBytes = 3072;

StackType_t stack[kStackBytes];
StaticTask_t task_memory;

// The fewest bytes of stack that each task ever had left. Housekeeping measures this, because it
// means reading all the free stack, which takes longer than the control task has.
struct StackLeft {
  const char* task;
  std::atomic<uint32_t> bytes{0};
};
StackLeft control_stack{"control"};
StackLeft housekeeping_stack{"housekeeping"};
StackLeft sensors_stack{"sensors"};
std::atomic<uint32_t> free_heap{0};
std::atomic<uint32_t> least_free_heap{0};

void measure_memory() {
  free_heap = esp_get_free_heap_size();
  least_free_heap = esp_get_minimum_free_heap_size();
  for (StackLeft* const each : {&control_stack, &housekeeping_stack, &sensors_stack}) {
    const TaskHandle_t task = xTaskGetHandle(each->task);
    if (task != nullptr) each->bytes = uxTaskGetStackHighWaterMark(task);
  }
}

/// Whether the LED is on. Short blinks: ready; steady: driving; slow blinking: timed out; fast
/// blinking: e-stop or fault.
constexpr bool is_lit(SupervisorState state, uint32_t time_ms) {
  switch (state) {
    case SupervisorState::kBoot:
      return false;
    case SupervisorState::kIdle:
      return time_ms % 2000 < 100;
    case SupervisorState::kDriving:
      return true;
    case SupervisorState::kTimedOut:
      return time_ms % 1000 < 500;
    case SupervisorState::kEstopped:
    case SupervisorState::kFault:
      return time_ms % 200 < 100;
  }
  return false;
}

}  // namespace

void Housekeeping::start(bool has_battery, int led_pin) {
  has_battery_ = has_battery;
  led_pin_ = led_pin;
  if (led_pin >= 0) make_low_output(led_pin);
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
  const SupervisorState state = state_.supervisor.load(std::memory_order_relaxed);
  if (led_pin_ >= 0) set_level(led_pin_, is_lit(state, cycles_ * kCycleMs));
  if (has_battery_ && cycles_ % kCyclesPerBattery == 0)
    state_.battery_mv.store(battery_.measure_millivolts(), std::memory_order_relaxed);
  if (cycles_ % kCyclesPerAnalog == 0) analog_.measure();
  // Also in the first cycle: a host may ask immediately.
  if (cycles_ % kCyclesPerMemory == 1) measure_memory();
}

void Housekeeping::serve(MessageServer& server, const Frame& frame, uint16_t request_id) {
  if (frame.id != MemoryGet::kId)
    return server.conclude(frame.id, request_id, RefusalCode::kNotSupported);
  server.answer_afresh(request_id, MemoryValue{.free_heap = free_heap,
                                               .least_free_heap = least_free_heap,
                                               .control_stack = control_stack.bytes,
                                               .housekeeping_stack = housekeeping_stack.bytes,
                                               .sensors_stack = sensors_stack.bytes});
}

}  // namespace wheelwire
