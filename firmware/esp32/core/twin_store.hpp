// A block in two slots, written alternately, so that no save overwrites the valid one.
#pragma once

#include "hal.hpp"

namespace wheelwire {

/// Each slot holds the block, a number that grows with each save, and a checksum over both; the
/// highest number is the valid one. A save goes to the other slot and is read back: flash that was
/// written while the power failed may take a later write badly, and a store that keeps its entries
/// there may lose one that it has just taken.
class TwinStore final : public ParameterStore {
 public:
  /// The longest block.
  static constexpr size_t kCapacity = 400;

  TwinStore(ParameterStore& first, ParameterStore& second) : slots_{&first, &second} {}

  size_t load(uint8_t* out, size_t capacity) override;
  bool save(const uint8_t* data, size_t size) override;
  bool erase() override;
  /// As of the last load(): 0 as long as one slot is good, or both are empty.
  uint32_t faults() override { return faults_; }

 private:
  struct Slot {
    size_t size = 0;  ///< Of the block; 0: it is empty or damaged.
    uint32_t number = 0;
    bool is_damaged = false;
  };

  /// Reads into buffer_.
  Slot read(int slot);
  /// The valid slot; -1 if there is none.
  int find(uint32_t& number);

  ParameterStore* slots_[2];
  uint32_t faults_ = 0;
  uint8_t buffer_[kCapacity + 8];
};

}  // namespace wheelwire
