// The clock of a test, and a timer that a test may have fail.
#pragma once

#include "esp_err.h"

/// Not 0: a power stage that is driven then would still wait for its pause.
inline int64_t fake_time_us = 1'000'000;
inline esp_err_t fake_timer_creation = ESP_OK;
inline esp_err_t fake_timer_start = ESP_OK;

inline int64_t esp_timer_get_time() { return fake_time_us; }

using esp_timer_handle_t = int*;
enum esp_timer_dispatch_t { ESP_TIMER_ISR };
struct esp_timer_create_args_t {
  void (*callback)(void*);
  void* arg;
  esp_timer_dispatch_t dispatch_method;
  const char* name;
  bool skip_unhandled_events;
};

inline esp_err_t esp_timer_create(const esp_timer_create_args_t*, esp_timer_handle_t* timer) {
  static int any;
  if (fake_timer_creation == ESP_OK) *timer = &any;
  return fake_timer_creation;
}
inline bool esp_timer_is_active(esp_timer_handle_t timer) {
  return timer != nullptr && fake_timer_start == ESP_OK;
}
inline esp_err_t esp_timer_start_periodic(esp_timer_handle_t timer, uint64_t) {
  return timer == nullptr ? ESP_FAIL : fake_timer_start;
}
inline esp_err_t esp_timer_restart(esp_timer_handle_t, uint64_t) { return fake_timer_start; }
inline void esp_timer_isr_dispatch_need_yield() {}
