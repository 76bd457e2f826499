// The configuration of an ESP32 DevKitC, as far as main/ asks for it.
#pragma once

#define CONFIG_IDF_TARGET_ESP32 1
#define CONFIG_BOOTLOADER_CUSTOM_RESERVE_RTC_SIZE 0x10
#define CONFIG_FREERTOS_NUMBER_OF_CORES 2
#define CONFIG_WHEELWIRE_BAUD_RATE 921600

// A test switches these off, one by one.
#ifndef CONFIG_GPTIMER_ISR_IRAM_SAFE
#define CONFIG_GPTIMER_ISR_IRAM_SAFE 1
#endif
#ifndef CONFIG_GPTIMER_CTRL_FUNC_IN_IRAM
#define CONFIG_GPTIMER_CTRL_FUNC_IN_IRAM 1
#endif
#ifndef CONFIG_MCPWM_ISR_IRAM_SAFE
#define CONFIG_MCPWM_ISR_IRAM_SAFE 1
#endif
