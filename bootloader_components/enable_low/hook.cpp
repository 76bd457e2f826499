// The bootloader's first act. A restart by software leaves the pins as they were; this ends it.
#include "release_pins.hpp"

/// Asked for by name when the bootloader is linked: without it this file would be left out.
extern "C" void bootloader_hooks_include() {}

namespace {

#if CONFIG_IDF_TARGET_ESP32
constexpr wheelwire::Board kChip = wheelwire::Board::kEsp32;
#elif CONFIG_IDF_TARGET_ESP32S3
constexpr wheelwire::Board kChip = wheelwire::Board::kEsp32s3;
#else
constexpr wheelwire::Board kChip = wheelwire::Board::kEsp32c6;
#endif

constexpr wheelwire::PinWords kDrivable =
    wheelwire::words_of(wheelwire::drivable_pins(*wheelwire::table_of(kChip)));

}  // namespace

/// Runs before memory is initialised: registers, ROM functions and RTC memory only.
extern "C" void bootloader_before_init() {
  const wheelwire::KeptRelease& kept = *wheelwire::kept_release();
  if (kept.is_valid()) {
    wheelwire::hold_low(kept.pins);
  } else {
    wheelwire::let_float(kDrivable);
  }
}
