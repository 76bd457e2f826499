// Stand-in for ESP-IDF's header of this name.
#pragma once

#include <stdint.h>

#define IRAM_ATTR
// Sections of their own, which a test can find: what start-up code sets up, and what it leaves.
#define DRAM_ATTR __attribute__((section("fake_dram")))
#define __NOINIT_ATTR __attribute__((section("fake_noinit")))
#define RTC_NOINIT_ATTR __attribute__((section("fake_rtc_noinit")))

extern "C" {
extern uint8_t __start_fake_dram[];
extern uint8_t __stop_fake_dram[];
extern uint8_t __start_fake_noinit[];
extern uint8_t __stop_fake_noinit[];
extern uint8_t __start_fake_rtc_noinit[];
extern uint8_t __stop_fake_rtc_noinit[];
}
