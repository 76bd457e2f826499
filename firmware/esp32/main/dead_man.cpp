#include "dead_man.hpp"

#include "drive_watchdog.hpp"
#include "esp_attr.h"
#include "esp_private/gptimer.h"
#include "freertos/FreeRTOS.h"
#include "moving_wheels.hpp"
#include "release_pins.hpp"

// The interrupts must be in RAM: else they wait, or crash, while a flash write has the cache off.
#if !CONFIG_GPTIMER_ISR_CACHE_SAFE || !CONFIG_GPTIMER_CTRL_FUNC_IN_IRAM
#error \
    "The dead-man needs CONFIG_GPTIMER_ISR_CACHE_SAFE=y and CONFIG_GPTIMER_CTRL_FUNC_IN_IRAM=y: they are in sdkconfig.defaults; delete the build folder, or its sdkconfig, and build again"
#endif

namespace wheelwire {
namespace {

constexpr uint32_t kMicrosecondHz = 1'000'000;

/// Takes a timer of the group with this core's number. The timers of a group share a lock: a core
/// that stops while holding it must not stop the other core's dead-man.
bool new_timer(gptimer_handle_t* timer) {
  const gptimer_config_t config = {
      .clk_src = GPTIMER_CLK_SRC_DEFAULT,
      .direction = GPTIMER_COUNT_UP,
      .resolution_hz = kMicrosecondHz,
      .intr_priority = 3,  // The highest that a handler in C++ can have.
      .flags = {},
  };
  int group = -1;
  do {  // The first group's timers are handed out first; skipped ones stay unused.
    if (gptimer_new_timer(&config, timer) != ESP_OK) return false;
    if (gptimer_get_group_id(*timer, &group) != ESP_OK) return false;
  } while (group != xPortGetCoreID());
  return true;
}

}  // namespace

IRAM_ATTR bool DeadMan::on_timer(gptimer_handle_t timer, const gptimer_alarm_event_data_t* event,
                                 void* context) {
  // The counter restarted at the alarm. If interrupts were off until it nearly reached the next
  // alarm or passed it, that alarm would be missed, and so would all later ones.
  if (event->count_value > kWatchPeriodUs / 2) gptimer_set_raw_count(timer, 0);
  auto& watcher = *static_cast<Watcher*>(context);
  const DeadMan& dead_man = *watcher.dead_man;
  const bool stopped = watcher.watch.check(dead_man.steps_.load(std::memory_order_relaxed),
                                           dead_man.limit_.load(std::memory_order_relaxed));
  const bool still = !dead_man.drives_.load(std::memory_order_relaxed) && moving_wheels.load() == 0;
  if (watcher.hold.must_release(stopped, still)) {
    release_motors();
    // Leaves the restart to the slower watchdogs, which write a core dump.
    disarm_drive_watchdog();
  }
  return false;
}

bool DeadMan::watch_from_this_core() {
  Watcher& watcher = watchers_[xPortGetCoreID()];
  watcher.dead_man = this;
  const gptimer_event_callbacks_t callbacks = {.on_alarm = on_timer};
  const gptimer_alarm_config_t alarm = {
      .alarm_count = kWatchPeriodUs,
      .reload_count = 0,
      .flags = {.auto_reload_on_alarm = true},
  };
  return new_timer(&watcher.timer) &&
         gptimer_register_event_callbacks(watcher.timer, &callbacks, &watcher) == ESP_OK &&
         gptimer_set_alarm_action(watcher.timer, &alarm) == ESP_OK &&
         gptimer_enable(watcher.timer) == ESP_OK && gptimer_start(watcher.timer) == ESP_OK;
}

}  // namespace wheelwire
