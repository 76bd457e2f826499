// EN of both bridges by direct register writes, which work where little else does: in the
// bootloader, in an interrupt while the cache is off, in a panic.
#pragma once

#include "board/board.hpp"
#include "soc/gpio_reg.h"
#include "soc/gpio_sig_map.h"
#include "soc/soc.h"

namespace wheelwire {

/// The register of the GPIO matrix that selects what drives a pin.
constexpr uint32_t output_route_register(int pin) {
  return GPIO_FUNC0_OUT_SEL_CFG_REG + 4 * static_cast<uint32_t>(pin);
}

// Pins are template arguments and everything is inlined: a table or a call might be in flash.

template <int pin>
[[gnu::always_inline]] inline void hold_low() {
  constexpr uint32_t bit = uint32_t{1} << (pin % 32);
  // Low first: the pin must not show its former level when it is taken from the PWM.
  REG_WRITE(pin < 32 ? GPIO_OUT_W1TC_REG : GPIO_OUT1_W1TC_REG, bit);
  REG_WRITE(output_route_register(pin), SIG_GPIO_OUT_IDX);
  REG_WRITE(pin < 32 ? GPIO_ENABLE_W1TS_REG : GPIO_ENABLE1_W1TS_REG, bit);
}

/// Takes EN of both bridges from the PWM and holds it low: both motors coast.
[[gnu::always_inline]] inline void hold_enables_low() {
  hold_low<kPins.left.enable>();
  hold_low<kPins.right.enable>();
}

}  // namespace wheelwire
