// The newest values of a series, in a fixed place.
#pragma once

#include <stdint.h>

namespace wheelwire {

template <typename T, uint32_t kCapacity>
class Ring {
 public:
  uint32_t size() const { return size_; }
  /// From the oldest one on.
  T& operator[](uint32_t index) { return values_[slot(index)]; }
  const T& operator[](uint32_t index) const { return values_[slot(index)]; }
  /// The place of the next one, which is the oldest one's if there is no room.
  T& push() {
    if (size_ == kCapacity) drop_oldest();
    return values_[slot(size_++)];
  }
  void drop_oldest() {
    first_ = slot(1);
    --size_;
  }
  void clear() { size_ = 0; }

 private:
  uint32_t slot(uint32_t index) const {
    const uint32_t from_start = first_ + index;
    return from_start < kCapacity ? from_start : from_start - kCapacity;
  }

  T values_[kCapacity];
  uint32_t first_ = 0;
  uint32_t size_ = 0;
};

}  // namespace wheelwire
