// Stand-in for ESP-IDF's header of this name.
#pragma once

#include <stdint.h>

struct portMUX_TYPE {};
#define portMUX_INITIALIZER_UNLOCKED \
  {                                  \
  }
#define portENTER_CRITICAL(lock) static_cast<void>(lock)
#define portEXIT_CRITICAL(lock) static_cast<void>(lock)
