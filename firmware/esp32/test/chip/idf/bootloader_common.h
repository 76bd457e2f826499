// The memory that outlives a restart.
#pragma once

#include <stdint.h>

#include "sdkconfig.h"

struct rtc_retain_mem_t {
  alignas(4) uint8_t custom[CONFIG_BOOTLOADER_CUSTOM_RESERVE_RTC_SIZE];
};

inline rtc_retain_mem_t fake_rtc_memory;

inline rtc_retain_mem_t* bootloader_common_get_rtc_retain_mem() { return &fake_rtc_memory; }
