// The state of the image that runs. A test sets it, and sees whether it is confirmed.
#pragma once

#include "esp_partition.h"

enum esp_ota_img_states_t { ESP_OTA_IMG_VALID = 2, ESP_OTA_IMG_PENDING_VERIFY = 1 };

struct FakeImage {
  esp_ota_img_states_t state = ESP_OTA_IMG_VALID;
  int confirmations = 0;  ///< Each one writes to flash.
};
inline FakeImage fake_image;

inline const esp_partition_t* esp_ota_get_running_partition() { return nullptr; }
inline esp_err_t esp_ota_get_state_partition(const esp_partition_t*, esp_ota_img_states_t* state) {
  *state = fake_image.state;
  return ESP_OK;
}
inline esp_err_t esp_ota_mark_app_valid_cancel_rollback() {
  ++fake_image.confirmations;
  return ESP_OK;
}
