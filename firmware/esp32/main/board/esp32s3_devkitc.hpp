// ESP32-S3-DevKitC-1.
#pragma once

#include "pins.hpp"

namespace wheelwire {

constexpr ChipPins kChipPins = {
    .existing = mask_of_range(0, 48) & ~mask_of_range(22, 25),
    .strapping = mask_of({0, 3, 45, 46}),
    // 33 to 37 belong to octal flash or PSRAM (modules N..R8).
    .memory = mask_of_range(26, 37),
    .input_only = 0,
    .adc1 = mask_of_range(1, 10),
    .uart0 = mask_of({43, 44}),
    .usb = mask_of({19, 20}),
};

constexpr Pins kBoardPins = {
    .left = {.enable = 4, .in1 = 5, .in2 = 6},
    .right = {.enable = 7, .in1 = 15, .in2 = 16},
    .left_encoder = {.a = 17, .b = 18},
    .right_encoder = {.a = 8, .b = 9},
    .encoder_pull_ups_fitted = false,
    .estop = 10,
    .battery = 1,
    .status_led = 2,
};

}  // namespace wheelwire
