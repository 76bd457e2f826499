// A block in the chip's non-volatile storage (NVS): a slot of a TwinStore.
#pragma once

#include "hal.hpp"
#include "nvs.h"
#include "nvs_flash.h"
#include "protocol.hpp"
#include "task_watchdog.hpp"

namespace wheelwire {

/// Formats only when the host asks for it: what cannot be read may still be needed. A cut of the
/// power may lose the block: a TwinStore has two.
class NvsStore final : public BlockStore {
 public:
  /// `key`: of the block, at most 15 letters.
  explicit NvsStore(const char* key) : key_(key) {}

  /// Never fails: without storage there is nothing to load, saving is refused, and faults() says
  /// why.
  void start() { open(); }

  size_t load(uint8_t* out, size_t capacity) override {
    const SlowOperation flash_read;
    if (!open_) return 0;
    size_t size = 0;
    esp_err_t result = nvs_get_blob(handle_, key_, nullptr, &size);
    if (result == ESP_ERR_NVS_NOT_FOUND) return 0;
    if (result == ESP_OK && size <= capacity) result = nvs_get_blob(handle_, key_, out, &size);
    faults_ = fault_of(result);
    return result == ESP_OK ? size : 0;
  }
  bool save(const uint8_t* data, size_t size) override {
    const SlowOperation flash_write;
    // Another block's call may have formatted the storage.
    if (!open_ && !open()) return false;
    if (nvs_set_blob(handle_, key_, data, size) != ESP_OK) return false;
    return nvs_commit(handle_) == ESP_OK;
  }
  bool format() override {
    const SlowOperation flash_write;
    // Another block's call may have done so.
    if (open_ || open()) return true;
    return nvs_flash_erase() == ESP_OK && open();
  }
  uint32_t faults() override { return faults_; }

 private:
  static constexpr char kNamespace[] = "wheelwire";

  static uint32_t fault_of(esp_err_t result) {
    switch (result) {
      case ESP_OK:
        return 0;
      case ESP_ERR_NVS_NO_FREE_PAGES:
        return fault::kStoreFull;
      case ESP_ERR_NVS_NEW_VERSION_FOUND:
        return fault::kStoreNewer;
      default:
        return fault::kStoreUnreadable;
    }
  }

  bool open() {
    esp_err_t result = nvs_flash_init();
    if (result == ESP_OK) result = nvs_open(kNamespace, NVS_READWRITE, &handle_);
    faults_ = fault_of(result);
    open_ = result == ESP_OK;
    return open_;
  }

  const char* key_;
  nvs_handle_t handle_ = 0;
  bool open_ = false;
  uint32_t faults_ = 0;
};

}  // namespace wheelwire
