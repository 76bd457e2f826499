// The core's state as numbers, field by field: never as an image of memory, which no other build
// could read. Each class names its own in a member `visit`: those that decide what later steps do.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire {

/// Writes each field as one word, or as two, the low one first.
class StateWriter {
 public:
  StateWriter(uint32_t* out, uint32_t* end) : out_(out), end_(end) {}

  template <typename T>
  void operator()(const char*, T& value) {
    if constexpr (requires { value.visit(*this); }) {
      value.visit(*this);
    } else if constexpr (sizeof(T) == 8) {
      put(static_cast<uint32_t>(value));
      put(static_cast<uint32_t>(static_cast<uint64_t>(value) >> 32));
    } else {
      put(static_cast<uint32_t>(value));
    }
  }
  void operator()(const char*, float& value) { put(__builtin_bit_cast(uint32_t, value)); }

  /// Behind the last word; nullptr: there was no room for all.
  uint32_t* end() const { return fits_ ? out_ : nullptr; }

 private:
  void put(uint32_t word) {
    if (out_ == end_) {
      fits_ = false;
      return;
    }
    *out_++ = word;
  }

  uint32_t* out_;
  uint32_t* end_;
  bool fits_ = true;
};

}  // namespace wheelwire
