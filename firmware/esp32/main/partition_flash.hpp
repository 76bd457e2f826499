// The partition of the flash in which the recorder has its black boxes and its ledger.
#pragma once

#include "esp_partition.h"
#include "flash_region.hpp"

namespace wheelwire {

/// An operation holds up the processor: a read for less than a millisecond, the erasure of a sector
/// for up to 400 ms. During that time, no other task and no interrupt in flash runs.
class PartitionFlash final : public FlashRegion {
 public:
  /// `size`: what is needed. False: the chip's partition table has no such partition, as one that
  /// was written by an older release, or by another firmware.
  bool start(uint32_t size);

  bool read(uint32_t offset, uint8_t* out, size_t size) override;
  bool write(uint32_t offset, const uint8_t* data, size_t size) override;
  bool erase(uint32_t offset) override;

 private:
  const esp_partition_t* partition_ = nullptr;
};

}  // namespace wheelwire
