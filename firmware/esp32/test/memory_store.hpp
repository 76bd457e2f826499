// A parameter store and a latch memory on the heap, for tests.
#pragma once

#include <algorithm>
#include <vector>

#include "hal.hpp"

namespace wheelwire {

class MemoryStore final : public BlockStore {
 public:
  size_t load(uint8_t* out, size_t capacity) override {
    std::copy_n(block.begin(), std::min(capacity, block.size()), out);
    return block.size();
  }
  bool save(const uint8_t* data, size_t size) override {
    ++saves;
    if (!failing) block.assign(data, data + size);
    return !failing;
  }

  std::vector<uint8_t> block;
  int saves = 0;
  bool failing = false;  ///< Saving fails, and changes nothing.
};

/// Survives a reset, as long as its owner does.
class MemoryLatches final : public LatchMemory {
 public:
  size_t load(uint8_t* out, size_t capacity) override {
    std::copy_n(record.begin(), std::min(capacity, record.size()), out);
    return record.size();
  }
  void save(const uint8_t* data, size_t size) override { record.assign(data, data + size); }

  std::vector<uint8_t> record;
};

}  // namespace wheelwire
