// One task, run by the test that creates it, and woken as that test says.
#pragma once

#include <functional>
#include <map>
#include <string>

#include "freertos/FreeRTOS.h"

using TaskHandle_t = void*;
enum eNotifyAction { eSetBits };

/// Waits in the place of a task: takes the longest time in ticks, and returns the bits that came.
inline std::function<uint32_t(TickType_t)> fake_wait;

/// A task sleeps for so many ticks.
inline std::function<void(TickType_t)> fake_sleep;
/// What it throws to end a task, which would never return.
struct EndOfTask {};
/// Runs a task to this end; false if it returns.
bool fake_run(auto task) {
  try {
    task();
  } catch (const EndOfTask&) {
    return true;
  }
  return false;
}
/// Of the task that was created last.
inline UBaseType_t fake_priority = 0;

/// For each running task, the bytes of its stack that were never used.
inline std::map<std::string, uint32_t> fake_stack_left;
inline TaskHandle_t xTaskGetHandle(const char* name) {
  const auto found = fake_stack_left.find(name);
  return found == fake_stack_left.end() ? nullptr : &found->second;
}
inline UBaseType_t uxTaskGetStackHighWaterMark(TaskHandle_t task) {
  return *static_cast<uint32_t*>(task);
}

inline TaskHandle_t xTaskCreateStaticPinnedToCore(void (*run)(void*), const char*, uint32_t,
                                                  void* context, UBaseType_t priority, StackType_t*,
                                                  StaticTask_t*, BaseType_t core) {
  fake_core = core;
  fake_priority = priority;
  run(context);
  return nullptr;
}
inline void vTaskDelay(TickType_t ticks) { fake_sleep(ticks); }
inline TickType_t xTaskGetTickCount() { return 0; }
inline void xTaskDelayUntil(TickType_t*, TickType_t ticks) { fake_sleep(ticks); }
inline TaskHandle_t xTaskGetCurrentTaskHandle() { return nullptr; }
inline BaseType_t xTaskNotifyFromISR(TaskHandle_t, uint32_t, eNotifyAction, BaseType_t*) {
  return pdTRUE;
}
inline BaseType_t xTaskNotifyWait(uint32_t, uint32_t, uint32_t* bits, TickType_t ticks) {
  *bits = fake_wait(ticks);
  return *bits != 0 ? pdTRUE : pdFALSE;
}
