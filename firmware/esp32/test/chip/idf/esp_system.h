// Stand-in for ESP-IDF's header of this name.
#pragma once

#include <stdint.h>

#include <functional>

inline std::function<void()> fake_restart = [] {};
inline void esp_restart() { fake_restart(); }

inline uint32_t fake_free_heap = 150'000;
inline uint32_t fake_least_free_heap = 140'000;
inline uint32_t esp_get_free_heap_size() { return fake_free_heap; }
inline uint32_t esp_get_minimum_free_heap_size() { return fake_least_free_heap; }
