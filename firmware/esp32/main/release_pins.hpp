// Holding the motors off by direct register writes, which work where little else does: in the
// bootloader, in an interrupt while the cache is off, in a panic.
#pragma once

#include "board_rules.hpp"
#include "bootloader_common.h"
#include "esp_rom_crc.h"
#include "soc/gpio_reg.h"
#include "soc/gpio_sig_map.h"
#include "soc/soc.h"

namespace wheelwire {

/// The register of the GPIO matrix that selects what drives a pin.
constexpr uint32_t output_route_register(int pin) {
  return GPIO_FUNC0_OUT_SEL_CFG_REG + 4 * static_cast<uint32_t>(pin);
}

/// GPIOs as bits of two words: on RV32 a 64-bit shift is a call, which may lead into flash.
struct PinWords {
  uint32_t low = 0;   ///< 0 to 31.
  uint32_t high = 0;  ///< 32 to 63.

  [[gnu::always_inline]] constexpr PinWords without(PinWords other) const {
    return {low & ~other.low, high & ~other.high};
  }
};

constexpr PinWords words_of(PinMask pins) {
  return {static_cast<uint32_t>(pins), static_cast<uint32_t>(pins >> 32)};
}
constexpr PinMask mask_of(PinWords pins) { return PinMask{pins.high} << 32 | pins.low; }

// Everything here is inlined: a call might be into flash.

/// Takes the pins from any peripheral: from here on they follow the GPIO registers.
[[gnu::always_inline]] inline void take_from_peripherals(PinWords pins) {
  for (int i = 0; i < 32; ++i) {
    if (pins.low >> i & 1) REG_WRITE(output_route_register(i), SIG_GPIO_OUT_IDX);
    if (pins.high >> i & 1) REG_WRITE(output_route_register(32 + i), SIG_GPIO_OUT_IDX);
  }
}

/// Takes the pins from the PWM and holds them low.
[[gnu::always_inline]] inline void hold_low(PinWords pins) {
  // Low first: a pin must not show its previous level when it leaves the PWM.
  REG_WRITE(GPIO_OUT_W1TC_REG, pins.low);
  if (pins.high != 0) REG_WRITE(GPIO_OUT1_W1TC_REG, pins.high);
  take_from_peripherals(pins);
  REG_WRITE(GPIO_ENABLE_W1TS_REG, pins.low);
  if (pins.high != 0) REG_WRITE(GPIO_ENABLE1_W1TS_REG, pins.high);
}

/// Takes the pins from the PWM and lets them float: the board's pull-downs hold the motors off.
[[gnu::always_inline]] inline void let_float(PinWords pins) {
  REG_WRITE(GPIO_ENABLE_W1TC_REG, pins.low);
  if (pins.high != 0) REG_WRITE(GPIO_ENABLE1_W1TC_REG, pins.high);
  take_from_peripherals(pins);
}

/// What the bootloader needs of a confirmed board after a software restart, which leaves the pins
/// unchanged. It is in RTC memory that no power-on clears, so it has a checksum.
struct SavedRelease {
  PinWords pins;
  uint32_t crc;

  bool is_valid() const {
    return crc == esp_rom_crc32_le(0, reinterpret_cast<const uint8_t*>(&pins), sizeof pins);
  }
  static SavedRelease of(PinWords pins) {
    return {pins, esp_rom_crc32_le(0, reinterpret_cast<const uint8_t*>(&pins), sizeof pins)};
  }
};

/// Its address, for the bootloader and the application.
inline SavedRelease* saved_release() {
  static_assert(sizeof(SavedRelease) <= CONFIG_BOOTLOADER_CUSTOM_RESERVE_RTC_SIZE);
  return reinterpret_cast<SavedRelease*>(bootloader_common_get_rtc_retain_mem()->custom);
}

/// What the bootloader has just pulled low; 0 after a power-on, or without a confirmed board.
PinMask saved_release_pins();

/// From now on a panic and the dead-man pull `pins` low, and the bootloader does `after_reset`.
void set_release_pins(PinMask pins, PinMask after_reset);

/// Holds both motors off. Works in any interrupt.
void release_motors();

}  // namespace wheelwire
