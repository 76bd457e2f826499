// The flash of a device: three blocks in two slots each, whose power can be cut at any write.
#pragma once

#include <array>

#include "configuration.hpp"
#include "memory_store.hpp"
#include "robot.hpp"
#include "twin_store.hpp"

namespace wheelwire::test {

/// A slot in flash, whose saves go wrong as a test says.
class FakeSlot final : public BlockStore {
 public:
  explicit FakeSlot(int* writes_left = nullptr) : left(writes_left) {}

  size_t load(uint8_t* out, size_t capacity) override { return memory.load(out, capacity); }
  bool save(const uint8_t* data, size_t size) override {
    ++saves;
    if (left != nullptr && *left <= 0) {
      if ((*left)-- == 0 && loses) memory.block.clear();
      return false;
    }
    if (left != nullptr) --*left;
    if (lost == 0) return memory.save(data, size);
    --lost;
    if (!keeps_old) memory.block.clear();
    return true;
  }
  uint32_t faults() override { return found; }

  MemoryStore memory;
  int* left;               ///< So many more before the power fails,
  bool loses = true;       ///< in the middle of a write: what was there is lost.
  int lost = 0;            ///< So many saves are taken, and lost,
  bool keeps_old = false;  ///< with what was there before, or without.
  int saves = 0;
  uint32_t found = 0;
};

/// Outlives each device on it. By StoredBlock.
struct SlotFlash {
  static constexpr int kPlenty = 1'000'000;

  int writes_left = kPlenty;
  std::array<std::array<FakeSlot, 2>, kStoredBlocks> slots{
      {{FakeSlot(&writes_left), FakeSlot(&writes_left)},
       {FakeSlot(&writes_left), FakeSlot(&writes_left)},
       {FakeSlot(&writes_left), FakeSlot(&writes_left)}}};
  std::array<TwinStore, kStoredBlocks> stores{
      {{slots[0][0], slots[0][1]}, {slots[1][0], slots[1][1]}, {slots[2][0], slots[2][1]}}};

  SlotFlash() { configuration().record(parameters(), latches()); }
  SlotFlash(const SlotFlash&) = delete;
  SlotFlash& operator=(const SlotFlash&) = delete;

  TwinStore& configuration() { return stores[0]; }
  TwinStore& parameters() { return stores[1]; }
  TwinStore& latches() { return stores[2]; }
  std::vector<uint8_t>& bytes(StoredBlock block, int slot) {
    return slots[static_cast<size_t>(block)][static_cast<size_t>(slot)].memory.block;
  }
};

}  // namespace wheelwire::test
