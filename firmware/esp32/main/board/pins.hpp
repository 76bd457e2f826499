// Which pins a board uses, and which its chip allows. No IDF, all at compile time.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire {

/// GPIO numbers as bits.
using PinMask = uint64_t;

constexpr PinMask mask_of(int pin) { return pin >= 0 && pin < 64 ? PinMask{1} << pin : 0; }

template <size_t count>
constexpr PinMask mask_of(const int (&pins)[count]) {
  PinMask mask = 0;
  for (const int pin : pins) mask |= mask_of(pin);
  return mask;
}

constexpr PinMask mask_of_range(int first, int last) {
  PinMask mask = 0;
  for (int pin = first; pin <= last; ++pin) mask |= mask_of(pin);
  return mask;
}

struct BridgePins {
  int enable;  ///< ENA or ENB, PWM.
  int in1;     ///< IN1 or IN3.
  int in2;     ///< IN2 or IN4.
};

struct EncoderPins {
  int a;
  int b;
};

struct Pins {
  BridgePins left;
  BridgePins right;
  EncoderPins left_encoder;
  EncoderPins right_encoder;
  bool encoder_pull_ups_fitted;  ///< External ones, on A and B of both.
  int estop;
  int battery;
  int status_led;
};

/// What a chip and its usual modules do with their pins.
struct ChipPins {
  PinMask existing;
  PinMask strapping;   ///< Their level at reset selects how the chip boots.
  PinMask memory;      ///< Flash and PSRAM.
  PinMask input_only;  ///< No output driver and no pull resistors.
  PinMask adc1;
  PinMask uart0;
  PinMask usb;  ///< Native USB.

  constexpr PinMask free() const { return existing & ~(strapping | memory | uart0 | usb); }
  constexpr bool can_listen(int pin) const { return (free() & mask_of(pin)) != 0; }
  constexpr bool can_drive(int pin) const {
    return can_listen(pin) && !(input_only & mask_of(pin));
  }
  /// For an input that must read high when its wire is broken.
  constexpr bool can_pull_up(int pin) const { return can_drive(pin); }
  /// Without a pull-up, an input floats while the encoder's open collector is off or its wire is
  /// broken: it picks up noise and counts ticks of a wheel that is at rest.
  constexpr bool can_count(int pin, bool pull_up_fitted) const {
    return can_listen(pin) && (pull_up_fitted || can_pull_up(pin));
  }
  constexpr bool can_measure(int pin) const { return can_listen(pin) && (adc1 & mask_of(pin)); }
};

/// True when no pin is used twice.
constexpr bool are_distinct(const Pins& pins) {
  const int used[] = {pins.left.enable,     pins.left.in1,       pins.left.in2,
                      pins.right.enable,    pins.right.in1,      pins.right.in2,
                      pins.left_encoder.a,  pins.left_encoder.b, pins.right_encoder.a,
                      pins.right_encoder.b, pins.estop,          pins.battery,
                      pins.status_led};
  PinMask seen = 0;
  for (const int pin : used) {
    if (seen & mask_of(pin)) return false;
    seen |= mask_of(pin);
  }
  return true;
}

}  // namespace wheelwire
