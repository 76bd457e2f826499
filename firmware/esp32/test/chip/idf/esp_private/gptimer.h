// Stand-in for ESP-IDF's header of this name.
#pragma once

#include "driver/gptimer.h"

inline esp_err_t gptimer_get_group_id(gptimer_handle_t timer, int* group) {
  *group = timer->group;
  return ESP_OK;
}
