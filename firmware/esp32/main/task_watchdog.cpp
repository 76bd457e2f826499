#include "task_watchdog.hpp"

#include <atomic>

#include "brake_hold.hpp"
#include "esp_task_wdt.h"

namespace wheelwire {
namespace {

constexpr uint32_t kLimitMs = 100;
constexpr uint32_t kSlowLimitMs = kMaxHoldUs / 1000;

/// How many slow operations are under way: one may be part of another.
std::atomic<int> slow_operations{0};

constexpr esp_task_wdt_config_t with_limit(uint32_t limit_ms) {
  return {.timeout_ms = limit_ms, .idle_core_mask = 0, .trigger_panic = true};
}

void set_limit(uint32_t limit_ms) {
  const esp_task_wdt_config_t config = with_limit(limit_ms);
  esp_task_wdt_reconfigure(&config);
}

}  // namespace

bool start_task_watchdog() {
  const esp_task_wdt_config_t config = with_limit(kLimitMs);
  return esp_task_wdt_init(&config) == ESP_OK;
}

bool watch_this_task() { return esp_task_wdt_add(nullptr) == ESP_OK; }

void feed_task_watchdog() { esp_task_wdt_reset(); }

SlowOperation::SlowOperation() {
  if (slow_operations.fetch_add(1) == 0) set_limit(kSlowLimitMs);
}

SlowOperation::~SlowOperation() {
  if (slow_operations.fetch_sub(1) == 1) set_limit(kLimitMs);
}

}  // namespace wheelwire
