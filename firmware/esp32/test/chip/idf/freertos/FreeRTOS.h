// Stand-in for ESP-IDF's header of this name.
#pragma once

#include <stdint.h>

using BaseType_t = int;
using UBaseType_t = unsigned;
using TickType_t = uint32_t;
using StackType_t = uint8_t;
struct StaticTask_t {};
struct portMUX_TYPE {};

constexpr BaseType_t pdTRUE = 1;
constexpr BaseType_t pdFALSE = 0;
constexpr UBaseType_t configMAX_PRIORITIES = 25;
constexpr UBaseType_t tskIDLE_PRIORITY = 0;

/// At CONFIG_FREERTOS_HZ = 1000.
constexpr TickType_t pdMS_TO_TICKS(uint64_t ms) { return static_cast<TickType_t>(ms); }

#define portMUX_INITIALIZER_UNLOCKED \
  {                                  \
  }
#define portENTER_CRITICAL(lock) static_cast<void>(lock)
#define portEXIT_CRITICAL(lock) static_cast<void>(lock)
#define portENTER_CRITICAL_ISR(lock) static_cast<void>(lock)
#define portEXIT_CRITICAL_ISR(lock) static_cast<void>(lock)
#define portDISABLE_INTERRUPTS() static_cast<void>(0)
#define portENABLE_INTERRUPTS() static_cast<void>(0)

/// The core on which the code under test runs.
inline int fake_core = 0;

inline int xPortGetCoreID() { return fake_core; }
