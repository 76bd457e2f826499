#include "control_task.hpp"

#include "clock.hpp"
#include "drive_watchdog.hpp"
#include "esp_attr.h"
#include "esp_system.h"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "release_pins.hpp"
#include "task_watchdog.hpp"

namespace wheelwire {
namespace {

// Why the task is woken.
constexpr uint32_t kStepDue = 1;
constexpr uint32_t kBytesCame = 2;

// Where there are two cores, this task has one for itself. The interrupts of the drivers and of the
// control timer are on the other.
constexpr BaseType_t kCore = CONFIG_FREERTOS_NUMBER_OF_CORES - 1;
constexpr UBaseType_t kPriority = configMAX_PRIORITIES - 1;
constexpr uint32_t kStackBytes = 8192;

/// Without its timer a robot still steps, this long after the last step, and can report the
/// failure. Longer than any period, shorter than the task watchdog.
constexpr uint64_t kLateStepUs = 50'000;

StackType_t stack[kStackBytes];
StaticTask_t task_memory;

}  // namespace

void ControlTask::start() {
  xTaskCreateStaticPinnedToCore(run, "control", kStackBytes, this, kPriority, stack, &task_memory,
                                kCore);
}

void ControlTask::run(void* self) {
  auto& task = *static_cast<ControlTask*>(self);
  if (!task.prepare()) task.device_.report_driver_failure();
  task.serve();
}

/// Does as much as it can: a robot that cannot drive still reports why, and keeps its latches.
bool ControlTask::prepare() {
  // Core 0 has been watched since start-up.
  const bool has_dead_man = kCore == 0 || dead_man_.watch_from_this_core();
  const TaskHandle_t self = xTaskGetCurrentTaskHandle();
  line_.notify(self, kBytesCame);
  const bool is_watched = start_robot();
  const esp_timer_create_args_t timer = {
      .callback = on_timer,
      .arg = self,
      .dispatch_method = ESP_TIMER_ISR,
      .name = "control",
      .skip_unhandled_events = true,
  };
  const bool has_timer = esp_timer_create(&timer, &timer_) == ESP_OK && follow_period();
  return has_dead_man && is_watched && has_timer;
}

/// Under the task watchdog from here on, so that a start that hangs restarts the chip, too. It
/// reads flash, which stalls both cores.
bool ControlTask::start_robot() {
  const SlowOperation flash_read;
  const bool is_watched = watch_this_task();
  device_.start(now_us());
  start_recorder();
  trial_.start();
  return is_watched;
}

/// After the device's start and before its first step or message.
void ControlTask::start_recorder() {
  if (recorder_ == nullptr) return;
  recorder_->start();
  device_.record(recorder_->black_box());
  device_.offer(*recorder_);
}

IRAM_ATTR void ControlTask::on_timer(void* task) {
  BaseType_t woken = pdFALSE;
  xTaskNotifyFromISR(static_cast<TaskHandle_t>(task), kStepDue, eSetBits, &woken);
  if (woken == pdTRUE) esp_timer_isr_dispatch_need_yield();
}

void ControlTask::serve() {
  for (;;) {
    uint32_t events = 0;
    xTaskNotifyWait(0, UINT32_MAX, &events, until_late_step());
    // Check the clock, too: a stream of bytes ends every wait before its time-out.
    if (events & kStepDue || until_late_step() == 0) {
      step();
    } else {
      device_.service_link(now_us());  // A ping is answered now, not at the next step.
    }
  }
}

TickType_t ControlTask::until_late_step() const {
  const uint64_t since_us = now_us() - stepped_us_;
  if (since_us >= kLateStepUs) return 0;
  // Rounded up: a wait that ends before its time would be repeated for nothing.
  return pdMS_TO_TICKS((kLateStepUs - since_us + 999) / 1000);
}

void ControlTask::step() {
  stepped_us_ = now_us();
  device_.step(stepped_us_);
  if (recorder_ != nullptr) recorder_->step(device_, now_us());
  trial_.step(device_, now_us());
  line_.push();
  dead_man_.feed(device_.state() == SupervisorState::kDriving);
  watch_drive();
  feed_task_watchdog();
  state_.supervisor.store(device_.state(), std::memory_order_relaxed);
  if (device_.control_period_us() != period_us_ && !follow_period())
    device_.report_driver_failure();
  if (device_.is_restart_due(now_us())) {
    release_motors();
    // Or a boot that crashes before it records would be explained by the steps of this one.
    if (recorder_ != nullptr) recorder_->black_box().clear();
    esp_restart();
  }
}

/// Sets timer and dead-man to the control period that the parameters give.
bool ControlTask::follow_period() {
  period_us_ = device_.control_period_us();
  const esp_err_t result = esp_timer_is_active(timer_)
                               ? esp_timer_restart(timer_, period_us_)
                               : esp_timer_start_periodic(timer_, period_us_);
  dead_man_.follow_period(period_us_);
  return result == ESP_OK;
}

void ControlTask::watch_drive() {
  const bool drives = device_.state() == SupervisorState::kDriving;
  if (drives) feed_drive_watchdog();
  if (drove_ && !drives) disarm_drive_watchdog();
  drove_ = drives;
}

}  // namespace wheelwire
