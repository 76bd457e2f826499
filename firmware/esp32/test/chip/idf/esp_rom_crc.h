#pragma once

#include "crc32.hpp"

inline uint32_t esp_rom_crc32_le(uint32_t, const uint8_t* data, uint32_t size) {
  return wheelwire::crc32(data, size);
}
