// A queue of bytes of a fixed size.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire::capi {

template <size_t kCapacity>
class ByteRing {
 public:
  void clear() { begin_ = size_ = 0; }
  size_t room() const { return kCapacity - size_; }

  /// Appends what there is room for; returns how many bytes.
  size_t push(const uint8_t* data, size_t size) {
    const size_t taken = size < room() ? size : room();
    for (size_t i = 0; i < taken; ++i) bytes_[(begin_ + size_ + i) % kCapacity] = data[i];
    size_ += taken;
    return taken;
  }

  /// Removes at most `capacity` bytes; returns how many.
  size_t pop(uint8_t* out, size_t capacity) {
    const size_t given = size_ < capacity ? size_ : capacity;
    for (size_t i = 0; i < given; ++i) out[i] = bytes_[(begin_ + i) % kCapacity];
    begin_ = (begin_ + given) % kCapacity;
    size_ -= given;
    return given;
  }

 private:
  uint8_t bytes_[kCapacity];
  size_t begin_ = 0;
  size_t size_ = 0;
};

}  // namespace wheelwire::capi
