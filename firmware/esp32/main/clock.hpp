#pragma once

#include "esp_timer.h"

namespace wheelwire {

/// The device clock: microseconds since reset.
inline uint64_t now_us() { return static_cast<uint64_t>(esp_timer_get_time()); }

}  // namespace wheelwire
