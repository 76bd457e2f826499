// Firmware that was installed over the link, on trial: image_trial.hpp says when it has passed.
#pragma once

#include "device.hpp"
#include "esp_ota_ops.h"
#include "image_trial.hpp"
#include "task_watchdog.hpp"

namespace wheelwire {

class OtaTrial {
 public:
  void start() {
    esp_ota_img_states_t state{};
    on_trial_ = esp_ota_get_state_partition(esp_ota_get_running_partition(), &state) == ESP_OK &&
                state == ESP_OTA_IMG_PENDING_VERIFY;
  }
  /// Call after each control step, from the control task: nothing can drive while it writes flash,
  /// which it does at rest only.
  void step(const Device& device, uint64_t now_us) {
    if (!on_trial_) return;
    if (!device.is_at_rest(now_us)) return;
    if (!has_proved_itself(now_us, device.has_session(), device.state(), device.faults())) return;
    on_trial_ = false;  // Tried once: if flash cannot be written, it would fail at every step.
    const SlowOperation flash_write;
    esp_ota_mark_app_valid_cancel_rollback();
  }

 private:
  bool on_trial_ = false;  ///< Never for firmware that was flashed by cable.
};

}  // namespace wheelwire
