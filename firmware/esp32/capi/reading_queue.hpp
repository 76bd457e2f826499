// Readings from the process that reads a bus to the one that steps the core, in order.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire::capi {

/// One side pushes, one pops, and neither waits. It may lie in memory that two processes share.
template <typename Value, uint32_t kCapacity>
class ReadingQueue {
 public:
  /// If it is full because nothing takes the values, this one is lost.
  void push(const Value& value) {
    const uint32_t end = __atomic_load_n(&end_, __ATOMIC_RELAXED);
    if (end - __atomic_load_n(&begin_, __ATOMIC_ACQUIRE) == kCapacity) return;
    values_[end % kCapacity] = value;
    __atomic_store_n(&end_, end + 1, __ATOMIC_RELEASE);
  }

  /// False if it is empty.
  bool pop(Value& out) {
    const uint32_t begin = __atomic_load_n(&begin_, __ATOMIC_RELAXED);
    if (begin == __atomic_load_n(&end_, __ATOMIC_ACQUIRE)) return false;
    out = values_[begin % kCapacity];
    __atomic_store_n(&begin_, begin + 1, __ATOMIC_RELEASE);
    return true;
  }

 private:
  static_assert((kCapacity & (kCapacity - 1)) == 0, "both indices wrap");

  Value values_[kCapacity]{};
  uint32_t begin_ = 0;
  uint32_t end_ = 0;
};

}  // namespace wheelwire::capi
