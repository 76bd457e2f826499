// Timers whose alarms a test rings.
#pragma once

#include <vector>

#include "esp_err.h"

struct gptimer_alarm_event_data_t {
  uint64_t count_value;
};
struct FakeGptimer;
using gptimer_handle_t = FakeGptimer*;
using gptimer_alarm_cb_t = bool (*)(gptimer_handle_t, const gptimer_alarm_event_data_t*, void*);

struct FakeGptimer {
  int group = 0;
  gptimer_alarm_cb_t on_alarm = nullptr;
  void* context = nullptr;

  void ring(int times = 1) {
    const gptimer_alarm_event_data_t event = {.count_value = 0};
    for (int i = 0; i < times; ++i) on_alarm(this, &event, context);
  }
};

inline FakeGptimer* fake_newest_timer = nullptr;

enum gptimer_clock_t { GPTIMER_CLK_SRC_DEFAULT };
enum gptimer_direction_t { GPTIMER_COUNT_UP };
struct gptimer_flags_t {
  uint32_t auto_reload_on_alarm;
};
struct gptimer_config_t {
  gptimer_clock_t clk_src;
  gptimer_direction_t direction;
  uint32_t resolution_hz;
  int intr_priority;
  gptimer_flags_t flags;
};
struct gptimer_event_callbacks_t {
  gptimer_alarm_cb_t on_alarm;
};
struct gptimer_alarm_config_t {
  uint64_t alarm_count;
  uint64_t reload_count;
  gptimer_flags_t flags;
};

inline esp_err_t gptimer_new_timer(const gptimer_config_t*, gptimer_handle_t* timer) {
  static FakeGptimer timers[4] = {{0}, {0}, {1}, {1}};
  static size_t next = 0;
  *timer = fake_newest_timer = &timers[next++ % 4];
  return ESP_OK;
}
inline esp_err_t gptimer_register_event_callbacks(gptimer_handle_t timer,
                                                  const gptimer_event_callbacks_t* callbacks,
                                                  void* context) {
  timer->on_alarm = callbacks->on_alarm;
  timer->context = context;
  return ESP_OK;
}
inline esp_err_t gptimer_set_alarm_action(gptimer_handle_t, const gptimer_alarm_config_t*) {
  return ESP_OK;
}
inline esp_err_t gptimer_enable(gptimer_handle_t) { return ESP_OK; }
inline esp_err_t gptimer_start(gptimer_handle_t) { return ESP_OK; }
inline esp_err_t gptimer_set_raw_count(gptimer_handle_t, uint64_t) { return ESP_OK; }
