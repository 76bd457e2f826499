// Stand-in for ESP-IDF's header of this name.
#pragma once

#include <functional>

inline std::function<void()> fake_restart = [] {};
inline void esp_restart() { fake_restart(); }
