// What outlives a reset: the latched e-stop and who latched it, the latched faults, a brake that
// was to last, a battery that was empty, and what ended the last motion.
#pragma once

#include "hal.hpp"
#include "last_stop.hpp"

namespace wheelwire {

/// In addition to the flags of `reflex`: the battery was at STOP, and was not charged since. By
/// itself it forbids nothing, but it outlasts a reset.
constexpr uint8_t kBatteryAtStop = 0x80;

/// In addition to the flags of `reflex`: a power stage reports a fault, and nothing else stops the
/// robot.
constexpr uint8_t kStageTripped = 0x40;

struct Latches {
  bool estop = false;
  bool holds = false;  ///< The robot brakes until it drives.
  bool battery_at_stop = false;
  uint32_t faults = 0;  ///< Flags of `fault`.
  // These decide nothing: they only tell.
  EstopSource source = EstopSource::kNone;
  bool moves = false;   ///< A setpoint drives the robot,
  uint32_t driver = 0;  ///< of this session.

  bool operator==(const Latches&) const = default;

  static constexpr size_t kSize = 16 + LastStop::kSize;
  /// Writes kSize bytes with a checksum; the last stop is in the same record.
  void encode(uint8_t* out, const LastStop& stop = {}) const;
  /// False if it is damaged, or not a record of latches.
  static bool decode(const uint8_t* data, size_t size, Latches& out, LastStop* stop = nullptr);
};

/// Keeps the latches in memory that survives a reset of the processor, and an e-stop's also in
/// flash, since a power-on and the reset pin clear that memory.
class LatchKeeper {
 public:
  LatchKeeper(LatchMemory& memory, BlockStore& store) : memory_(memory), store_(store) {}

  /// What was latched before the reset. A record that cannot be read counts as an e-stop: it may
  /// have been one.
  Latches start();
  /// Call whenever they may have changed. Cheap while they have not.
  void note(const Latches& latches) {
    if (latches == latches_) return;
    latches_ = latches;
    write_memory();
  }
  /// What ended the last motion. The next note of something that has changed keeps it, too.
  LastStop& stop() { return stop_; }
  const LastStop& stop() const { return stop_; }
  void note_stop() { write_memory(); }
  /// Call while the wheels stand, see Robot::is_at_rest: writes to flash what has to be there.
  /// Returns whether it did, which may have stalled the processor.
  bool sync_at_rest(uint64_t now_us);
  /// Of the last write to flash.
  bool write_failed() const { return write_failed_; }

 private:
  /// Between two notes of an e-stop in flash, which wears: a contact may chatter for hours.
  static constexpr uint64_t kNoteIntervalUs = 10'000'000;

  void write_memory();

  LatchMemory& memory_;
  BlockStore& store_;
  Latches latches_;
  LastStop stop_;
  bool is_stored_ = false;   ///< Flash says that an e-stop is latched.
  bool is_damaged_ = false;  ///< Flash says nothing that can be read.
  bool write_failed_ = false;
  uint64_t next_note_us_ = 0;
};

}  // namespace wheelwire
