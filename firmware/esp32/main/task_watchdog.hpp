// The task watchdog: a task that hangs causes a panic, and that a silent restart. (The command
// watchdog, which stops a robot whose host is gone, is in the core.)
#pragma once

#include <atomic>

#include "brake_hold.hpp"
#include "esp_task_wdt.h"

namespace wheelwire {

constexpr esp_task_wdt_config_t task_watchdog_of(uint32_t limit_ms) {
  return {.timeout_ms = limit_ms, .idle_core_mask = 0, .trigger_panic = true};
}

constexpr esp_task_wdt_config_t kTaskWatchdog = task_watchdog_of(100);
constexpr esp_task_wdt_config_t kSlowTaskWatchdog = task_watchdog_of(kMaxHoldUs / 1000);

inline bool start_task_watchdog() { return esp_task_wdt_init(&kTaskWatchdog) == ESP_OK; }

/// Watches the calling task, which must feed it from now on.
inline bool watch_this_task() { return esp_task_wdt_add(nullptr) == ESP_OK; }
inline void feed_task_watchdog() { esp_task_wdt_reset(); }

/// While one exists, tasks may stall for longer: flash access stalls both cores, and erasing a
/// sector takes up to some hundred milliseconds. The core writes only while stopped; during a
/// write, the dead-man holds EN low or leaves a brake on.
class SlowOperation {
 public:
  SlowOperation() {
    if (under_way_.fetch_add(1) == 0) esp_task_wdt_reconfigure(&kSlowTaskWatchdog);
  }
  ~SlowOperation() {
    if (under_way_.fetch_sub(1) == 1) esp_task_wdt_reconfigure(&kTaskWatchdog);
  }
  SlowOperation(const SlowOperation&) = delete;
  SlowOperation& operator=(const SlowOperation&) = delete;

 private:
  static inline std::atomic<int> under_way_{0};  ///< One may be part of another.
};

}  // namespace wheelwire
