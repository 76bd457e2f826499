// Below the scheduler: when no control step has run for some time, interrupts hold EN low. They
// need no task, no flash and no driver. step_watch.hpp says when.
#pragma once

#include <atomic>

#include "driver/gptimer.h"
#include "sdkconfig.h"
#include "step_watch.hpp"

namespace wheelwire {

class DeadMan {
 public:
  /// Watches from the core that calls this, once from each: so one of them sees whichever core
  /// stands still, or has its interrupts off.
  bool watch_from_this_core();
  /// A control step ran.
  void feed() { steps_.fetch_add(1, std::memory_order_relaxed); }
  void follow_period(uint32_t control_period_us) {
    limit_.store(looks_without_a_step(control_period_us), std::memory_order_relaxed);
  }

 private:
  /// All that an interrupt uses.
  struct Watcher {
    DeadMan* dead_man;
    StepWatch watch;
    gptimer_handle_t timer;
  };

  static bool on_timer(gptimer_handle_t timer, const gptimer_alarm_event_data_t* event,
                       void* watcher);

  std::atomic<uint32_t> steps_{0};
  std::atomic<uint32_t> limit_{looks_without_a_step(0)};
  Watcher watchers_[CONFIG_FREERTOS_NUMBER_OF_CORES]{};
};

}  // namespace wheelwire
