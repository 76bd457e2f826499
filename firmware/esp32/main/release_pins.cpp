#include "release_pins.hpp"

#include "esp_attr.h"

namespace wheelwire {
namespace {

/// In RAM, for interrupts while the cache is off. None before the board is known.
DRAM_ATTR PinWords in_use;

}  // namespace

void set_release_pins(PinMask pins) {
  in_use = words_of(pins);
  *kept_release() = KeptRelease::of(in_use);
}

IRAM_ATTR void release_motors() { hold_low(in_use); }

}  // namespace wheelwire
