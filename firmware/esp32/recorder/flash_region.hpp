// A part of the flash, as the recorder uses it. A test can cut the power in any operation.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire {

constexpr uint32_t kFlashSector = 4096;

class FlashRegion {
 public:
  virtual bool read(uint32_t offset, uint8_t* out, size_t size) = 0;
  /// Only clears bits: what is written was erased before.
  virtual bool write(uint32_t offset, const uint8_t* data, size_t size) = 0;
  /// Sets all bits of the sector at `offset`.
  virtual bool erase(uint32_t offset) = 0;

 protected:
  ~FlashRegion() = default;
};

/// Whether `size` bytes from `offset` on are erased; reads them to `buffer`.
inline bool is_blank(FlashRegion& flash, uint32_t offset, uint8_t* buffer, size_t size) {
  if (!flash.read(offset, buffer, size)) return false;
  for (size_t i = 0; i < size; ++i)
    if (buffer[i] != 0xff) return false;
  return true;
}

}  // namespace wheelwire
