#include "housekeeping.hpp"

#include "esp_system.h"
#include "freertos/task.h"
#include "robot_bench.hpp"
#include "sensor_hub.hpp"
#include "task_watchdog.hpp"

using namespace wheelwire;

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
    if (slept_ms > 2000) throw EndOfTask{};
    if (slept_ms > 500 && state.battery_mv == 0) zero_ms += ticks;
    if (slept_ms > 1000 && zero_ms == 0) {
      fake_adc.fails = true;
      reads = fake_adc.reads;
    }
    if (fake_adc.reads != reads) fake_adc.fails = false;
  };
  Housekeeping housekeeping{battery, inputs, state};
  CHECK(fake_run([&] { housekeeping.start(true, -1); }));
  fake_sleep = nullptr;
  CHECK(zero_ms > 0 && zero_ms * 1000 < SensorHub::kZeroUs / 2);
  CHECK(state.battery_mv == 7400);
}

TEST(a_host_is_told_how_much_memory_is_left) {
  test::RobotBench bench;
  bench.open();
  CHECK(bench.ask<GroupInfo>(GroupGet{.group = Group::kPlatform})->hash == 0);
  CHECK(bench.refusal(MemoryGet{}) == RefusalCode::kNotSupported);

  Battery battery;
  AnalogInputs inputs;
  SharedState state;
  Housekeeping housekeeping{battery, inputs, state};
  fake_free_heap = 90'000;
  fake_least_free_heap = 80'000;
  fake_stack_left = {{"control", 5000}, {"housekeeping", 1800}};
  CHECK(start_task_watchdog());
  uint32_t slept_ms = 0;
  fake_sleep = [&](TickType_t ticks) {
    slept_ms += ticks;
    if (slept_ms == 500) fake_stack_left["control"] = 4000;
    if (slept_ms > 1500) throw EndOfTask{};
  };
  CHECK(fake_run([&] { housekeeping.start(false, -1); }));
  fake_sleep = nullptr;
  fake_stack_left.clear();

  bench.device.offer(housekeeping);
  CHECK(bench.ask<GroupInfo>(GroupGet{.group = Group::kPlatform})->hash ==
        hash_of(Group::kPlatform));
  const auto left = bench.ask<MemoryValue>(MemoryGet{});
  CHECK(left->free_heap == 90'000 && left->least_free_heap == 80'000);
  CHECK(left->control_stack == 4000 && left->housekeeping_stack == 1800);
  CHECK(left->sensors_stack == 0);
}
