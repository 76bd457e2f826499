#include "dead_man.hpp"

#include "drive_watchdog.hpp"
#include "enable_pins.hpp"
#include "esp_attr.h"
#include "freertos/FreeRTOS.h"

namespace wheelwire {
namespace {

constexpr uint32_t kMicrosecondHz = 1'000'000;

}  // namespace

IRAM_ATTR bool DeadMan::on_timer(gptimer_handle_t timer, const gptimer_alarm_event_data_t*,
                                 void* context) {
  // Interrupts may have been off for longer than a period: an alarm that has been passed must not
  // be the last one.
  gptimer_set_raw_count(timer, 0);
  auto& watcher = *static_cast<Watcher*>(context);
  const DeadMan& dead_man = *watcher.dead_man;
  if (watcher.watch.look(dead_man.steps_.load(std::memory_order_relaxed),
                         dead_man.limit_.load(std::memory_order_relaxed))) {
    hold_enables_low();
    // The slower watchdogs restart the chip, and leave a core dump.
    disarm_drive_watchdog();
  }
  return false;
}

bool DeadMan::watch_from_this_core() {
  Watcher& watcher = watchers_[xPortGetCoreID()];
  watcher.dead_man = this;
  const gptimer_config_t config = {
      .clk_src = GPTIMER_CLK_SRC_DEFAULT,
      .direction = GPTIMER_COUNT_UP,
      .resolution_hz = kMicrosecondHz,
      .intr_priority = 3,  // The highest that a handler in C++ can have.
      .flags = {},
  };
  const gptimer_event_callbacks_t callbacks = {.on_alarm = on_timer};
  const gptimer_alarm_config_t alarm = {
      .alarm_count = kWatchPeriodUs,
      .reload_count = 0,
      .flags = {.auto_reload_on_alarm = true},
  };
  return gptimer_new_timer(&config, &watcher.timer) == ESP_OK &&
         gptimer_register_event_callbacks(watcher.timer, &callbacks, &watcher) == ESP_OK &&
         gptimer_set_alarm_action(watcher.timer, &alarm) == ESP_OK &&
         gptimer_enable(watcher.timer) == ESP_OK && gptimer_start(watcher.timer) == ESP_OK;
}

}  // namespace wheelwire
