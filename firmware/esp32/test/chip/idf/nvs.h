// NVS with one entry, in memory. A test sets what it finds.
#pragma once

#include <string.h>

#include <functional>
#include <vector>

#include "esp_err.h"

constexpr esp_err_t ESP_ERR_NVS_NOT_FOUND = 0x1102;
constexpr esp_err_t ESP_ERR_NVS_NO_FREE_PAGES = 0x110d;
constexpr esp_err_t ESP_ERR_NVS_NEW_VERSION_FOUND = 0x1110;
constexpr esp_err_t ESP_ERR_NVS_PART_NOT_FOUND = 0x110f;

using nvs_handle_t = uint32_t;
enum nvs_open_mode_t { NVS_READONLY, NVS_READWRITE };

struct FakeNvs {
  esp_err_t init_result = ESP_OK;  // until it is erased
  esp_err_t read_result = ESP_OK;
  std::vector<uint8_t> blob;
  int erasures = 0;
};

inline FakeNvs fake_nvs;
/// What happens while flash is written.
inline std::function<void()> fake_on_commit;

inline esp_err_t nvs_open(const char*, nvs_open_mode_t, nvs_handle_t* handle) {
  *handle = 7;
  return ESP_OK;
}

inline esp_err_t nvs_get_blob(nvs_handle_t, const char*, void* out, size_t* size) {
  if (fake_nvs.read_result != ESP_OK) return fake_nvs.read_result;
  if (fake_nvs.blob.empty()) return ESP_ERR_NVS_NOT_FOUND;
  if (out != nullptr) memcpy(out, fake_nvs.blob.data(), fake_nvs.blob.size());
  *size = fake_nvs.blob.size();
  return ESP_OK;
}

inline esp_err_t nvs_set_blob(nvs_handle_t, const char*, const void* data, size_t size) {
  const auto* bytes = static_cast<const uint8_t*>(data);
  fake_nvs.blob.assign(bytes, bytes + size);
  return ESP_OK;
}

inline esp_err_t nvs_commit(nvs_handle_t) {
  if (fake_on_commit) fake_on_commit();
  return ESP_OK;
}
