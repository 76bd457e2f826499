// Stands in for ESP-IDF where the chip's own sources are compiled for this computer.
#pragma once

#include <stdint.h>

using esp_err_t = int;
constexpr esp_err_t ESP_OK = 0;
constexpr esp_err_t ESP_FAIL = -1;
