// Independent of the scheduler: when no control step has run for some time, interrupts hold EN low.
// They need no task, no flash and no driver. step_watch.hpp says when.
#pragma once

#include <atomic>

#include "driver/gptimer.h"
#include "sdkconfig.h"
#include "step_watch.hpp"

namespace wheelwire {

class DeadMan {
 public:
  /// Starts watching from the calling core. Call it once on each core: then one notices if the
  /// other hangs, or has its interrupts off.
  bool watch_from_this_core();
  /// Call after each control step.
  void feed() { steps_.fetch_add(1, std::memory_order_relaxed); }
  void follow_period(uint32_t control_period_us) {
    limit_.store(checks_without_a_step(control_period_us), std::memory_order_relaxed);
  }

 private:
  /// All state that an interrupt uses.
  struct Watcher {
    DeadMan* dead_man;
    StepWatch watch;
    gptimer_handle_t timer;
  };

  static bool on_timer(gptimer_handle_t timer, const gptimer_alarm_event_data_t* event,
                       void* watcher);

  std::atomic<uint32_t> steps_{0};
  std::atomic<uint32_t> limit_{checks_without_a_step(0)};
  Watcher watchers_[CONFIG_FREERTOS_NUMBER_OF_CORES]{};
};

}  // namespace wheelwire
