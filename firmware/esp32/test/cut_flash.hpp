// Flash in memory, in which the power can go in the middle of any operation.
#pragma once

#include <algorithm>
#include <random>
#include <vector>

#include "check.hpp"
#include "flash_region.hpp"

namespace wheelwire::test {

class CutFlash final : public FlashRegion {
 public:
  /// How far the operation is in which the power goes: it has not begun, it is in the middle, or
  /// only its end is not reported any more.
  enum class Cut { kBefore, kInside, kAfter };

  explicit CutFlash(size_t size) : bytes(size, 0xff) {}

  bool read(uint32_t offset, uint8_t* out, size_t size) override {
    CHECK(offset + size <= bytes.size());
    std::copy_n(bytes.begin() + offset, size, out);
    return true;
  }
  bool write(uint32_t offset, const uint8_t* data, size_t size) override {
    CHECK(offset + size <= bytes.size());
    if (failing || is_off()) return false;
    const bool cut = goes_now();
    // Some bits of what is written when the power goes are cleared, and some are not.
    for (size_t i = 0; i < size; ++i)
      bytes[offset + i] &= static_cast<uint8_t>(data[i] | (cut ? left_undone() : 0));
    return !cut;
  }
  bool erase(uint32_t offset) override {
    CHECK(offset % kFlashSector == 0 && offset + kFlashSector <= bytes.size());
    if (failing || is_off()) return false;
    const bool cut = goes_now();
    for (size_t i = 0; i < kFlashSector; ++i)
      bytes[offset + i] |= static_cast<uint8_t>(cut ? ~left_undone() : 0xff);
    ++erasures;
    return !cut;
  }

  /// The power goes in the operation that comes after so many.
  void cut_after(size_t others, Cut how = Cut::kInside) {
    left_ = static_cast<int64_t>(others);
    how_ = how;
  }
  void power_on() { left_ = -1; }
  bool is_off() const { return left_ == kOff; }

  std::vector<uint8_t> bytes;
  size_t erasures = 0;
  size_t operations = 0;
  bool failing = false;

 private:
  static constexpr int64_t kOff = -2;

  /// Bits of a byte that the operation in which the power goes does not change.
  uint8_t left_undone() {
    if (how_ == Cut::kInside) return static_cast<uint8_t>(random_());
    return how_ == Cut::kBefore ? 0xff : 0;
  }
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
  Cut how_ = Cut::kInside;
  int64_t left_ = -1;
};

}  // namespace wheelwire::test
