// A queue of bytes in a fixed place, for one task or thread.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire {

template <size_t kCapacity>
class ByteQueue {
 public:
  void clear() { begin_ = size_ = 0; }
  size_t room() const { return kCapacity - size_; }

  /// Appends all of the bytes; or none, and returns false.
  bool put(const uint8_t* data, size_t size) {
    if (size > room()) return false;
    for (size_t i = 0; i < size; ++i) bytes_[(begin_ + size_ + i) % kCapacity] = data[i];
    size_ += size;
    return true;
  }

  /// The oldest bytes, as many as are contiguous.
  const uint8_t* front() const { return bytes_ + begin_; }
  size_t front_size() const { return size_ < kCapacity - begin_ ? size_ : kCapacity - begin_; }

  /// Removes the oldest `size` bytes, at most all.
  void drop(size_t size) {
    begin_ = (begin_ + size) % kCapacity;
    size_ -= size;
  }

  /// Removes at most `capacity` bytes; returns how many.
  size_t take(uint8_t* out, size_t capacity) {
    const size_t taken = size_ < capacity ? size_ : capacity;
    for (size_t i = 0; i < taken; ++i) out[i] = bytes_[(begin_ + i) % kCapacity];
    drop(taken);
    return taken;
  }

 private:
  uint8_t bytes_[kCapacity];
  size_t begin_ = 0;
  size_t size_ = 0;
};

}  // namespace wheelwire
