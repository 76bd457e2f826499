// The configuration of an ESP32 DevKitC, as far as main/ asks for it.
#pragma once

#define CONFIG_IDF_TARGET_ESP32 1
#define CONFIG_BOOTLOADER_CUSTOM_RESERVE_RTC_SIZE 0x10
