#include "crc32.hpp"

#ifndef WHEELWIRE_CRC_BYTES_A_STEP
#define WHEELWIRE_CRC_BYTES_A_STEP 1  // More is faster, and takes a table of 1 KB each.
#endif

namespace wheelwire {
namespace {

constexpr size_t kStep = WHEELWIRE_CRC_BYTES_A_STEP;

/// entry[n][byte]: the register after a byte and n zero bytes.
struct Tables {
  uint32_t entry[kStep][256];
};

constexpr Tables kTables = [] {
  Tables tables{};
  for (uint32_t i = 0; i < 256; ++i) {
    uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ (value & 1 ? 0xedb88320u : 0);
    tables.entry[0][i] = value;
  }
  for (size_t n = 1; n < kStep; ++n) {
    for (uint32_t i = 0; i < 256; ++i) {
      const uint32_t before = tables.entry[n - 1][i];
      tables.entry[n][i] = before >> 8 ^ tables.entry[0][before & 0xff];
    }
  }
  return tables;
}();

/// The register after `size` more bytes, kStep at most.
inline uint32_t absorb(uint32_t crc, const uint8_t* data, size_t size) {
  uint32_t next = size < 4 ? crc >> 8 * size : 0;
  for (size_t i = 0; i < size; ++i) {
    const uint32_t byte = i < 4 ? (data[i] ^ crc >> 8 * i) & 0xff : data[i];
    next ^= kTables.entry[size - 1 - i][byte];
  }
  return next;
}

}  // namespace

uint32_t crc32(const uint8_t* data, size_t size) {
  uint32_t crc = 0xffffffffu;
  for (; size >= kStep; data += kStep, size -= kStep) crc = absorb(crc, data, kStep);
  if constexpr (kStep > 1) crc = absorb(crc, data, size);
  return ~crc;
}

}  // namespace wheelwire
