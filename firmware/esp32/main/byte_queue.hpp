#pragma once

#include <stddef.h>
#include <stdint.h>
#include <string.h>

namespace wheelwire {

/// A ring buffer of bytes, for use by one task.
template <size_t capacity>
class ByteQueue {
 public:
  /// Appends all of the bytes; or none, and returns false.
  bool put(const uint8_t* data, size_t size) {
    if (size > capacity - size_) return false;
    const size_t end = (begin_ + size_) % capacity;
    const size_t first = size < capacity - end ? size : capacity - end;
    memcpy(bytes_ + end, data, first);
    memcpy(bytes_, data + first, size - first);
    size_ += size;
    return true;
  }

  /// The oldest bytes, as many as are contiguous.
  const uint8_t* front() const { return bytes_ + begin_; }
  size_t front_size() const { return size_ < capacity - begin_ ? size_ : capacity - begin_; }

  /// Removes the oldest `size` bytes, at most front_size().
  void drop(size_t size) {
    begin_ = (begin_ + size) % capacity;
    size_ -= size;
  }

 private:
  uint8_t bytes_[capacity];
  size_t begin_ = 0;
  size_t size_ = 0;
};

}  // namespace wheelwire
