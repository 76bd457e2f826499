// The flash of a device: three blocks in two slots each, whose power can be cut at any write.
#pragma once

#include <array>

#include "configuration.hpp"
#include "memory_store.hpp"
#include "robot.hpp"
#include "twin_store.hpp"

namespace wheelwire::test {

/// A slot in flash. Where the power goes in the middle of a write, what was there is lost.
class CutSlot final : public BlockStore {
 public:
  explicit CutSlot(int& writes_left) : writes_left_(writes_left) {}

  size_t load(uint8_t* out, size_t capacity) override { return memory.load(out, capacity); }
  bool save(const uint8_t* data, size_t size) override {
    if (writes_left_ <= 0) {
      if (writes_left_-- == 0 && loses) memory.block.clear();
      return false;
    }
    --writes_left_;
    return memory.save(data, size);
  }

  MemoryStore memory;
  bool loses = true;

 private:
  int& writes_left_;
};

/// Outlives each device on it. By StoredBlock.
struct SlotFlash {
  static constexpr int kPlenty = 1'000'000;

  int writes_left = kPlenty;
  std::array<std::array<CutSlot, 2>, kStoredBlocks> slots{
      {{CutSlot(writes_left), CutSlot(writes_left)},
       {CutSlot(writes_left), CutSlot(writes_left)},
       {CutSlot(writes_left), CutSlot(writes_left)}}};
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
