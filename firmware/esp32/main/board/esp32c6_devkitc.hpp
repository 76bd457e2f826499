// ESP32-C6-DevKitC-1.
#pragma once

#include "pins.hpp"

namespace wheelwire {

constexpr ChipPins kChipPins = {
    .existing = mask_of_range(0, 30) & ~mask_of(14),
    .strapping = mask_of({4, 5, 8, 9, 15}),
    .memory = mask_of_range(24, 30),
    .input_only = 0,
    .adc1 = mask_of_range(0, 6),
    .uart0 = mask_of({16, 17}),
    .usb = mask_of({12, 13}),
};

constexpr Pins kBoardPins = {
    .left = {.enable = 10, .in1 = 18, .in2 = 19},
    .right = {.enable = 11, .in1 = 20, .in2 = 21},
    .left_encoder = {.a = 2, .b = 3},
    .right_encoder = {.a = 22, .b = 23},
    .encoder_pull_ups_fitted = false,
    .estop = 1,
    .battery = 0,
    .status_led = 7,
};

}  // namespace wheelwire
