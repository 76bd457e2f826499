// Flash in memory, in which the power can go in the middle of any operation.
#pragma once

#include <algorithm>
#include <random>
#include <vector>

#include "flash_region.hpp"

namespace wheelwire::test {

class CutFlash final : public FlashRegion {
 public:
  explicit CutFlash(size_t size) : bytes(size, 0xff) {}

  bool read(uint32_t offset, uint8_t* out, size_t size) override {
    std::copy_n(bytes.begin() + offset, size, out);
    return true;
  }
  bool write(uint32_t offset, const uint8_t* data, size_t size) override {
    if (failing || is_off()) return false;
    const bool cut = goes_now();
    for (size_t i = 0; i < size; ++i) {
      // Some bits of what is written when the power goes are cleared, and some are not.
      const auto lost = static_cast<uint8_t>(cut ? random_() : 0);
      bytes[offset + i] &= static_cast<uint8_t>(data[i] | lost);
    }
    return !cut;
  }
  bool erase(uint32_t offset) override {
    if (failing || is_off()) return false;
    const bool cut = goes_now();
    for (size_t i = 0; i < kFlashSector; ++i)
      bytes[offset + i] |= static_cast<uint8_t>(cut ? random_() : 0xff);
    ++erasures;
    return !cut;
  }

  /// The power goes in the operation that comes after so many.
  void cut_after(size_t others) { left_ = static_cast<int64_t>(others); }
  void power_on() { left_ = -1; }
  bool is_off() const { return left_ == kOff; }

  std::vector<uint8_t> bytes;
  size_t erasures = 0;
  size_t operations = 0;
  bool failing = false;

 private:
  static constexpr int64_t kOff = -2;

  bool goes_now() {
    ++operations;
    if (left_ == 0) {
      left_ = kOff;
      return true;
    }
    if (left_ > 0) --left_;
    return false;
  }

  std::mt19937 random_{5};
  int64_t left_ = -1;
};

}  // namespace wheelwire::test
