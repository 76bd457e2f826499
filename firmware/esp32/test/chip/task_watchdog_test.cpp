#include "task_watchdog.hpp"

#include "check.hpp"
#include "esp_task_wdt.h"

using namespace wheelwire;

TEST(a_slow_operation_may_be_part_of_another) {
  CHECK(start_task_watchdog());
  const uint32_t usual_ms = fake_task_watchdog.timeout_ms;
  CHECK(usual_ms == 100);
  {
    const SlowOperation outer;
    const uint32_t slow_ms = fake_task_watchdog.timeout_ms;
    CHECK(slow_ms > usual_ms);
    {
      const SlowOperation inner;
    }
    CHECK(fake_task_watchdog.timeout_ms == slow_ms);
  }
  CHECK(fake_task_watchdog.timeout_ms == usual_ms);
}
