#pragma once

#include <stdint.h>

constexpr uint32_t SIG_GPIO_OUT_IDX = 256;
