// Stand-in for ESP-IDF's header of this name.
#pragma once

#include <stdint.h>

#include <functional>

/// Called with the time that is waited for.
inline std::function<void(uint32_t)> fake_on_delay;

constexpr uint32_t esp_rom_get_cpu_ticks_per_us() { return 240; }
inline void esp_rom_delay_us(uint32_t us) {
  if (fake_on_delay) fake_on_delay(us);
}
