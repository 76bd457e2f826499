// Instructions, counted by the processor itself.
#pragma once

#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

namespace wheelwire::rv32 {

/// Instructions retired since power-on, modulo 2^32.
inline uint32_t retired() {
  uint32_t count;
  asm volatile("csrr %0, instret" : "=r"(count) : : "memory");
  return count;
}

/// Instructions that `work` takes, without those for counting.
template <typename Work>
uint32_t instructions(Work&& work) {
  const uint32_t begin = retired();
  const uint32_t idle = retired();
  work();
  const uint32_t end = retired();
  return (end - idle) - (idle - begin);
}

/// Counts of one kind of work over a run.
class Counts {
 public:
  static constexpr size_t kCapacity = 8192;

  void add(uint32_t count) {
    if (size_ < kCapacity) counts_[size_++] = count;
  }
  size_t size() const { return size_; }
  /// Of some values.
  uint32_t median() { return sorted()[size_ / 2]; }
  uint32_t max() { return sorted()[size_ - 1]; }

 private:
  const uint32_t* sorted() {
    qsort(counts_, size_, sizeof counts_[0], compare);
    return counts_;
  }
  static int compare(const void* a, const void* b) {
    const uint32_t left = *static_cast<const uint32_t*>(a);
    const uint32_t right = *static_cast<const uint32_t*>(b);
    return (left > right) - (left < right);
  }

  uint32_t counts_[kCapacity];
  size_t size_ = 0;
};

}  // namespace wheelwire::rv32
