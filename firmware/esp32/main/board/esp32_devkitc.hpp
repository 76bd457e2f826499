// ESP32-DevKitC V4 and its many relatives with an ESP32-WROOM-32.
#pragma once

#include "pins.hpp"

namespace wheelwire {

constexpr ChipPins kChipPins = {
    .existing = mask_of_range(0, 39) & ~mask_of({20, 24, 28, 29, 30, 31, 37, 38}),
    .strapping = mask_of({0, 2, 5, 12, 15}),
    // 16 and 17 belong to the PSRAM of a WROVER module.
    .memory = mask_of_range(6, 11) | mask_of({16, 17}),
    .input_only = mask_of_range(34, 39),
    .adc1 = mask_of_range(32, 39),
    .uart0 = mask_of({1, 3}),
    .usb = 0,
};

/// 21 and 22 are the usual I2C pins; 21 stays free, 22 too where no LED is wanted.
constexpr Pins kBoardPins = {
    .left = {.enable = 25, .in1 = 26, .in2 = 27},
    .right = {.enable = 33, .in1 = 32, .in2 = 4},
    .left_encoder = {.a = 18, .b = 19},
    .right_encoder = {.a = 23, .b = 13},
    .encoder_pull_ups_fitted = false,
    .estop = 14,
    .battery = 34,
    .status_led = 22,
};

}  // namespace wheelwire
