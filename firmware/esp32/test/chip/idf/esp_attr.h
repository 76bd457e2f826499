// Stand-in for ESP-IDF's header of this name.
#pragma once

#include <stdint.h>

#define IRAM_ATTR
#define DRAM_ATTR
/// A section of its own, which a test can find: what a reset of the chip leaves, and what not.
#define RTC_NOINIT_ATTR __attribute__((section("fake_rtc_noinit")))

extern "C" {
extern uint8_t __start_fake_rtc_noinit[];
extern uint8_t __stop_fake_rtc_noinit[];
}
