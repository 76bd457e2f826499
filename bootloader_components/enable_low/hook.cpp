// The bootloader's first act. A restart by software leaves the pins as they were; this ends it.
#include "release_pins.hpp"

/// Asked for by name when the bootloader is linked: without it this file would be left out.
extern "C" void bootloader_hooks_include() {}

namespace {

#if CONFIG_IDF_TARGET_ESP32
constexpr wheelwire::Chip kChip = wheelwire::Chip::kEsp32;
#elif CONFIG_IDF_TARGET_ESP32S3
constexpr wheelwire::Chip kChip = wheelwire::Chip::kEsp32s3;
#else
constexpr wheelwire::Chip kChip = wheelwire::Chip::kEsp32c6;
#endif

constexpr wheelwire::PinWords kDrivable =
    wheelwire::words_of(wheelwire::drivable_pins(*wheelwire::table_of(kChip)));

}  // namespace

/// Runs before memory is initialised: registers, ROM functions and RTC memory only.
extern "C" void bootloader_before_init() {
  const wheelwire::SavedRelease& saved = *wheelwire::saved_release();
  const wheelwire::PinWords held = saved.is_valid() ? saved.pins : wheelwire::PinWords{};
  // First what ends the drive.
  wheelwire::hold_low(held);
  wheelwire::let_float(kDrivable.without(held));
}
