// Stand-in for ESP-IDF's header of this name.
#pragma once

#include <stdint.h>

inline void esp_rom_delay_us(uint32_t) {}
