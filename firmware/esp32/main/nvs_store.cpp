#include "nvs_store.hpp"

#include "nvs_flash.h"
#include "task_watchdog.hpp"

namespace wheelwire {
namespace {

constexpr char kNamespace[] = "wheelwire";
constexpr char kKey[] = "parameters";

}  // namespace

void NvsStore::start() {
  esp_err_t result = nvs_flash_init();
  if (result == ESP_ERR_NVS_NO_FREE_PAGES || result == ESP_ERR_NVS_NEW_VERSION_FOUND) {
    lost_ = true;
    result = nvs_flash_erase();
    if (result == ESP_OK) result = nvs_flash_init();
  }
  open_ = result == ESP_OK && nvs_open(kNamespace, NVS_READWRITE, &handle_) == ESP_OK;
}

size_t NvsStore::load(uint8_t* out, size_t capacity) {
  size_t size = 0;
  if (open_ && nvs_get_blob(handle_, kKey, nullptr, &size) == ESP_OK) {
    if (size <= capacity) nvs_get_blob(handle_, kKey, out, &size);
    return size;
  }
  if (!lost_ || capacity == 0) return 0;
  // A block of one byte is none: the core reports it as corrupt, which is what happened.
  out[0] = 0;
  return 1;
}

bool NvsStore::save(const uint8_t* data, size_t size) {
  const SlowOperation flash_write;
  if (!open_ || nvs_set_blob(handle_, kKey, data, size) != ESP_OK) return false;
  return nvs_commit(handle_) == ESP_OK;
}

bool NvsStore::erase() {
  const SlowOperation flash_write;
  if (!open_) return false;
  const esp_err_t result = nvs_erase_key(handle_, kKey);
  if (result != ESP_OK && result != ESP_ERR_NVS_NOT_FOUND) return false;
  lost_ = false;
  return nvs_commit(handle_) == ESP_OK;
}

}  // namespace wheelwire
