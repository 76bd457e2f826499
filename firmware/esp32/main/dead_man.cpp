#include "dead_man.hpp"

#include "enable_pins.hpp"
#include "esp_attr.h"

namespace wheelwire {
namespace {

constexpr uint32_t kMicrosecondHz = 1'000'000;

IRAM_ATTR bool release_drive(gptimer_handle_t, const gptimer_alarm_event_data_t*, void*) {
  hold_enables_low();
  return false;
}

}  // namespace

bool DeadMan::start() {
  const gptimer_config_t config = {
      .clk_src = GPTIMER_CLK_SRC_DEFAULT,
      .direction = GPTIMER_COUNT_UP,
      .resolution_hz = kMicrosecondHz,
      .intr_priority = 3,  // The highest that a handler in C++ can have.
      .flags = {},
  };
  const gptimer_event_callbacks_t callbacks = {.on_alarm = release_drive};
  return gptimer_new_timer(&config, &timer_) == ESP_OK &&
         gptimer_register_event_callbacks(timer_, &callbacks, nullptr) == ESP_OK &&
         gptimer_enable(timer_) == ESP_OK;
}

bool DeadMan::set_limit(uint32_t limit_us) {
  // Reloaded, so that it fires again and again: a step that hangs may switch EN on once more.
  const gptimer_alarm_config_t alarm = {
      .alarm_count = limit_us,
      .reload_count = 0,
      .flags = {.auto_reload_on_alarm = true},
  };
  if (gptimer_set_alarm_action(timer_, &alarm) != ESP_OK) return false;
  if (!watching_) watching_ = gptimer_start(timer_) == ESP_OK;
  return watching_;
}

}  // namespace wheelwire
