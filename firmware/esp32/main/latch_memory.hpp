// The latches, in memory that outlasts a restart, a panic and a watchdog, but not a power-on.
#pragma once

#include "hal.hpp"
#include "latches.hpp"

namespace wheelwire {

/// Two records in RTC memory that start-up code leaves as it is (RTC_NOINIT), and a spare one in
/// ordinary memory (NOINIT), since not every chip keeps its RTC memory when the RTC watchdog resets
/// all of it. It is not the few bytes that the bootloader keeps: an installed bootloader may be
/// older than this firmware.
///
/// A power-on, the EN pin and a brown-out leave any bytes in it, so a checksum decides what is a
/// record, never the reason for the reset. An e-stop is in flash as well, for that case.
class RtcLatchMemory final : public LatchMemory {
 public:
  /// 0 when no record is whole.
  size_t load(uint8_t* out, size_t capacity) override;
  /// One after the other: a reset in between leaves one whole.
  void save(const uint8_t* data, size_t size) override;
};

}  // namespace wheelwire
