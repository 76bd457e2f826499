// The bootloader's first act. A restart by software leaves the pins as they were; this ends it.
#include "enable_pins.hpp"
#include "esp_rom_gpio.h"

/// Asked for by name when the bootloader is linked: without it this file would be left out.
extern "C" void bootloader_hooks_include() {}

/// Runs before memory is initialised: registers and ROM functions only.
extern "C" void bootloader_before_init() {
  using wheelwire::kPins;
  wheelwire::hold_enables_low();
  esp_rom_gpio_pad_select_gpio(kPins.left.enable);
  esp_rom_gpio_pad_select_gpio(kPins.right.enable);
}
