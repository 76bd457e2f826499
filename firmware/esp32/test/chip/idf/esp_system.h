// Stand-in for ESP-IDF's header of this name.
#pragma once

inline void esp_restart() {}
