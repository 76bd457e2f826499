// The task watchdog as far as a test looks at it.
#pragma once

#include "esp_err.h"

struct esp_task_wdt_config_t {
  uint32_t timeout_ms;
  uint32_t idle_core_mask;
  bool trigger_panic;
};

struct FakeTaskWatchdog {
  uint32_t timeout_ms = 0;
  int feeds = 0;
  int restarts = 0;  ///< A new limit restarts its time, too.
};
inline FakeTaskWatchdog fake_task_watchdog;

inline esp_err_t esp_task_wdt_init(const esp_task_wdt_config_t* config) {
  fake_task_watchdog.timeout_ms = config->timeout_ms;
  return ESP_OK;
}
inline esp_err_t esp_task_wdt_reconfigure(const esp_task_wdt_config_t* config) {
  ++fake_task_watchdog.restarts;
  fake_task_watchdog.timeout_ms = config->timeout_ms;
  return ESP_OK;
}
inline esp_err_t esp_task_wdt_add(void*) { return ESP_OK; }
inline esp_err_t esp_task_wdt_reset() {
  ++fake_task_watchdog.feeds;
  return ESP_OK;
}
