// CRC-32 as in zlib: polynomial 0x04C11DB7 reflected, start and final XOR all ones.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire {

/// The CRC-32 of any data followed by its own CRC-32, little-endian.
constexpr uint32_t kCrcResidue = 0x2144df1c;

uint32_t crc32(const uint8_t* data, size_t size);

}  // namespace wheelwire
