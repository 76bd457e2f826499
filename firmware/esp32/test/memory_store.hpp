// A parameter store and a latch memory on the heap, for tests.
#pragma once

#include <algorithm>
#include <vector>

#include "crc32.hpp"
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

/// A block as earlier firmware wrote it: behind it a number and the checksum over both.
inline std::vector<uint8_t> sealed(std::vector<uint8_t> block, uint32_t number) {
  const auto append = [&block](uint32_t value) {
    for (int i = 0; i < 4; ++i) block.push_back(static_cast<uint8_t>(value >> 8 * i));
  };
  append(number);
  append(crc32(block.data(), block.size()));
  return block;
}

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
