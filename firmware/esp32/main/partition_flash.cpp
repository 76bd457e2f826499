#include "partition_flash.hpp"

#include "task_watchdog.hpp"

namespace wheelwire {

bool PartitionFlash::start(uint32_t size) {
  partition_ =
      esp_partition_find_first(ESP_PARTITION_TYPE_DATA, ESP_PARTITION_SUBTYPE_ANY, "recorder");
  return partition_ != nullptr && partition_->size >= size &&
         partition_->erase_size == kFlashSector && !partition_->readonly;
}

bool PartitionFlash::read(uint32_t offset, uint8_t* out, size_t size) {
  const SlowOperation flash_read;
  return esp_partition_read(partition_, offset, out, size) == ESP_OK;
}

bool PartitionFlash::write(uint32_t offset, const uint8_t* data, size_t size) {
  const SlowOperation flash_write;
  return esp_partition_write(partition_, offset, data, size) == ESP_OK;
}

bool PartitionFlash::erase(uint32_t offset) {
  const SlowOperation flash_write;
  return esp_partition_erase_range(partition_, offset, kFlashSector) == ESP_OK;
}

}  // namespace wheelwire
