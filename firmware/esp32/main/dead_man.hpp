// Independent of the scheduler: when no control step has run for some time, interrupts hold EN low.
// They need no task, no flash and no driver. step_watch.hpp says when. brake_hold.hpp says when a
// brake stays on instead, as during a flash operation.
#pragma once

#include <atomic>

#include "brake_hold.hpp"
#include "driver/gptimer.h"
#include "sdkconfig.h"
#include "step_watch.hpp"

namespace wheelwire {

class DeadMan {
 public:
  /// Starts watching from the calling core. Call it once on each core: then one notices if the
  /// other hangs, or has its interrupts off.
  bool watch_from_this_core();
  /// Call after each control step. `drives`: the robot is DRIVING, so its deadline counts, and
  /// nothing is held.
  void feed(bool drives) {
    drives_.store(drives, std::memory_order_relaxed);
    steps_.fetch_add(1, std::memory_order_relaxed);
  }
  void follow_period(uint32_t control_period_us) {
    limit_.store(checks_without_a_step(control_period_us), std::memory_order_relaxed);
  }

 private:
  /// All state that an interrupt uses.
  struct Watcher {
    DeadMan* dead_man;
    StepWatch watch;
    BrakeHold hold;
    gptimer_handle_t timer;
  };

  static bool on_timer(gptimer_handle_t timer, const gptimer_alarm_event_data_t* event,
                       void* watcher);

  std::atomic<uint32_t> steps_{0};
  std::atomic<bool> drives_{true};
  std::atomic<uint32_t> limit_{checks_without_a_step(0)};
  Watcher watchers_[CONFIG_FREERTOS_NUMBER_OF_CORES]{};
};

}  // namespace wheelwire
