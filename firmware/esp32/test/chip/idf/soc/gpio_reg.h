// Addresses of the GPIO registers; which ones is of no matter here.
#pragma once

#include <stdint.h>

constexpr uint32_t GPIO_OUT_W1TC_REG = 0x0c;
constexpr uint32_t GPIO_OUT1_W1TC_REG = 0x18;
constexpr uint32_t GPIO_ENABLE_W1TS_REG = 0x24;
constexpr uint32_t GPIO_ENABLE1_W1TS_REG = 0x30;
constexpr uint32_t GPIO_ENABLE_W1TC_REG = 0x28;
constexpr uint32_t GPIO_ENABLE1_W1TC_REG = 0x34;
constexpr uint32_t GPIO_IN_REG = 0x3c;
constexpr uint32_t GPIO_IN1_REG = 0x40;
constexpr uint32_t GPIO_FUNC0_OUT_SEL_CFG_REG = 0x530;
