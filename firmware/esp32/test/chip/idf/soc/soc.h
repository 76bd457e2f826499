#pragma once

#include "gpio_matrix.hpp"
#include "sdkconfig.h"

inline void REG_WRITE(uint32_t address, uint32_t value) { fake_matrix.write(address, value); }
inline uint32_t REG_READ(uint32_t address) { return fake_matrix.registers[address]; }
