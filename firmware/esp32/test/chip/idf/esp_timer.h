// The clock of a test.
#pragma once

#include "esp_err.h"

inline int64_t fake_time_us = 0;

inline int64_t esp_timer_get_time() { return fake_time_us; }
