#include "housekeeping.hpp"

#include "check.hpp"
#include "freertos/task.h"
#include "sensor_hub.hpp"
#include "task_watchdog.hpp"

using namespace wheelwire;

namespace {

struct End {};

}  // namespace

TEST(one_measurement_that_fails_is_no_broken_wire) {
  fake_adc = {};
  fake_adc.millivolts = {{34, 1850}};
  Adc adc;
  Battery battery;
  AnalogInputs inputs;
  SharedState state;
  CHECK(start_task_watchdog());
  CHECK(battery.start({.battery = 34, .battery_divider_permille = 4000}, adc));
  uint32_t slept_ms = 0;
  uint32_t zero_ms = 0;
  int reads = 0;
  fake_sleep = [&](TickType_t ticks) {
    slept_ms += ticks;
    if (slept_ms > 2000) throw End{};
    if (slept_ms > 500 && state.battery_mv == 0) zero_ms += ticks;
    if (slept_ms > 1000 && zero_ms == 0) {
      fake_adc.fails = true;
      reads = fake_adc.reads;
    }
    if (fake_adc.reads != reads) fake_adc.fails = false;
  };
  Housekeeping housekeeping{battery, inputs, state};
  try {
    housekeeping.start(true, -1);
    CHECK(false);  // Its task never ends.
  } catch (const End&) {
  }
  fake_sleep = nullptr;
  CHECK(zero_ms > 0 && zero_ms * 1000 < SensorHub::kZeroUs / 2);
  CHECK(state.battery_mv == 7400);
}
