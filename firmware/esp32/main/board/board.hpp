// The pins of this build: the board's, unless the configuration says otherwise. A pin that the chip
// cannot use in its role, or that would keep it from booting, does not compile.
#pragma once

#include "sdkconfig.h"

#if CONFIG_IDF_TARGET_ESP32
#include "esp32_devkitc.hpp"
#elif CONFIG_IDF_TARGET_ESP32S3
#include "esp32s3_devkitc.hpp"
#elif CONFIG_IDF_TARGET_ESP32C6
#include "esp32c6_devkitc.hpp"
#else
#error "Wheelwire runs on ESP32, ESP32-S3 and ESP32-C6: the motors need MCPWM, the encoders PCNT."
#endif

namespace wheelwire {

/// A negative number in the configuration selects the board's pin.
constexpr int chosen(int configured, int of_board) {
  return configured >= 0 ? configured : of_board;
}

#ifdef CONFIG_WHEELWIRE_ENCODER_PULL_UPS_FITTED
constexpr bool kPullUpsFitted = true;
#else
constexpr bool kPullUpsFitted = kBoardPins.encoder_pull_ups_fitted;
#endif

constexpr Pins kPins = {
    .left = {.enable = chosen(CONFIG_WHEELWIRE_PIN_LEFT_ENABLE, kBoardPins.left.enable),
             .in1 = chosen(CONFIG_WHEELWIRE_PIN_LEFT_IN1, kBoardPins.left.in1),
             .in2 = chosen(CONFIG_WHEELWIRE_PIN_LEFT_IN2, kBoardPins.left.in2)},
    .right = {.enable = chosen(CONFIG_WHEELWIRE_PIN_RIGHT_ENABLE, kBoardPins.right.enable),
              .in1 = chosen(CONFIG_WHEELWIRE_PIN_RIGHT_IN1, kBoardPins.right.in1),
              .in2 = chosen(CONFIG_WHEELWIRE_PIN_RIGHT_IN2, kBoardPins.right.in2)},
    .left_encoder = {.a = chosen(CONFIG_WHEELWIRE_PIN_LEFT_A, kBoardPins.left_encoder.a),
                     .b = chosen(CONFIG_WHEELWIRE_PIN_LEFT_B, kBoardPins.left_encoder.b)},
    .right_encoder = {.a = chosen(CONFIG_WHEELWIRE_PIN_RIGHT_A, kBoardPins.right_encoder.a),
                      .b = chosen(CONFIG_WHEELWIRE_PIN_RIGHT_B, kBoardPins.right_encoder.b)},
    .encoder_pull_ups_fitted = kPullUpsFitted,
    .estop = chosen(CONFIG_WHEELWIRE_PIN_ESTOP, kBoardPins.estop),
    .battery = chosen(CONFIG_WHEELWIRE_PIN_BATTERY, kBoardPins.battery),
    .status_led = chosen(CONFIG_WHEELWIRE_PIN_STATUS_LED, kBoardPins.status_led),
};

static_assert(kChipPins.can_drive(kPins.left.enable), "left EN: choose a pin that can drive");
static_assert(kChipPins.can_drive(kPins.left.in1), "left IN1: choose a pin that can drive");
static_assert(kChipPins.can_drive(kPins.left.in2), "left IN2: choose a pin that can drive");
static_assert(kChipPins.can_drive(kPins.right.enable), "right EN: choose a pin that can drive");
static_assert(kChipPins.can_drive(kPins.right.in1), "right IN1: choose a pin that can drive");
static_assert(kChipPins.can_drive(kPins.right.in2), "right IN2: choose a pin that can drive");
static_assert(kChipPins.can_listen(kPins.left_encoder.a), "left A: choose a free pin");
static_assert(kChipPins.can_listen(kPins.left_encoder.b), "left B: choose a free pin");
static_assert(kChipPins.can_listen(kPins.right_encoder.a), "right A: choose a free pin");
static_assert(kChipPins.can_listen(kPins.right_encoder.b), "right B: choose a free pin");
static_assert(kChipPins.can_count(kPins.left_encoder.a, kPullUpsFitted),
              "left A: the pin has no pull-up; choose another, or fit pull-ups on the "
              "encoders and say so: CONFIG_WHEELWIRE_ENCODER_PULL_UPS_FITTED");
static_assert(kChipPins.can_count(kPins.left_encoder.b, kPullUpsFitted),
              "left B: the pin has no pull-up; choose another, or fit pull-ups on the "
              "encoders and say so: CONFIG_WHEELWIRE_ENCODER_PULL_UPS_FITTED");
static_assert(kChipPins.can_count(kPins.right_encoder.a, kPullUpsFitted),
              "right A: the pin has no pull-up; choose another, or fit pull-ups on the "
              "encoders and say so: CONFIG_WHEELWIRE_ENCODER_PULL_UPS_FITTED");
static_assert(kChipPins.can_count(kPins.right_encoder.b, kPullUpsFitted),
              "right B: the pin has no pull-up; choose another, or fit pull-ups on the "
              "encoders and say so: CONFIG_WHEELWIRE_ENCODER_PULL_UPS_FITTED");
static_assert(kChipPins.can_pull_up(kPins.estop), "e-stop: choose a pin with a pull-up");
static_assert(kChipPins.can_measure(kPins.battery), "battery: choose a pin of ADC1");
static_assert(kChipPins.can_drive(kPins.status_led), "status LED: choose a pin that can drive");
static_assert(are_distinct(kPins), "a pin is used twice");

}  // namespace wheelwire
