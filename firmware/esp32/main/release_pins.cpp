#include "release_pins.hpp"

#include "esp_attr.h"

namespace wheelwire {
namespace {

/// In RAM, for interrupts while the cache is off. Empty before the board is known.
DRAM_ATTR PinWords in_use;

}  // namespace

PinMask saved_release_pins() {
  const SavedRelease& saved = *saved_release();
  return saved.is_valid() ? mask_of(saved.pins) : 0;
}

void set_release_pins(PinMask pins, PinMask after_reset) {
  in_use = words_of(pins);
  *saved_release() = SavedRelease::of(words_of(after_reset));
}

IRAM_ATTR void release_motors() { hold_low(in_use); }

}  // namespace wheelwire
