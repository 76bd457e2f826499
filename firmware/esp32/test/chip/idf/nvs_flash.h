#pragma once

#include "nvs.h"

inline esp_err_t nvs_flash_init() { return fake_nvs.init_result; }

inline esp_err_t nvs_flash_erase() {
  ++fake_nvs.erasures;
  fake_nvs.blob.clear();
  fake_nvs.init_result = ESP_OK;
  fake_nvs.read_result = ESP_OK;
  return ESP_OK;
}
