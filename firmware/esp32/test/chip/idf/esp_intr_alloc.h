// Stand-in for ESP-IDF's header of this name.
#pragma once

constexpr int ESP_INTR_FLAG_IRAM = 1 << 10;
