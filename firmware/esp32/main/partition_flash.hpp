// The partition of the flash in which the recorder has its black boxes and its ledger.
#pragma once

#include "esp_partition.h"
#include "flash_region.hpp"
#include "task_watchdog.hpp"

namespace wheelwire {

/// An operation holds up the processor: a read for less than a millisecond, the erasure of a sector
/// for up to 400 ms. During that time, no other task and no interrupt in flash runs.
class PartitionFlash final : public FlashRegion {
 public:
  /// `size`: what is needed. False: the chip's partition table has no such partition, as one that
  /// was written by an older release, or by another firmware.
  bool start(uint32_t size) {
    partition_ =
        esp_partition_find_first(ESP_PARTITION_TYPE_DATA, ESP_PARTITION_SUBTYPE_ANY, "recorder");
    return partition_ != nullptr && partition_->size >= size &&
           partition_->erase_size == kFlashSector && !partition_->readonly;
  }

  bool read(uint32_t offset, uint8_t* out, size_t size) override {
    const SlowOperation flash_read;
    return esp_partition_read(partition_, offset, out, size) == ESP_OK;
  }
  bool write(uint32_t offset, const uint8_t* data, size_t size) override {
    const SlowOperation flash_write;
    return esp_partition_write(partition_, offset, data, size) == ESP_OK;
  }
  bool erase(uint32_t offset) override {
    const SlowOperation flash_write;
    return esp_partition_erase_range(partition_, offset, kFlashSector) == ESP_OK;
  }

 private:
  const esp_partition_t* partition_ = nullptr;
};

}  // namespace wheelwire
