// What outlives a reset: the latched e-stop and who latched it, the latched faults, a brake that
// was to last, a battery that was empty, and what ended the last motion.
#pragma once

#include <string.h>

#include "crc32.hpp"
#include "hal.hpp"
#include "protocol.hpp"
#include "wire.hpp"

namespace wheelwire {

/// In addition to the flags of `reflex`: the battery was at STOP, and was not charged since. By
/// itself it forbids nothing, but it outlasts a reset.
constexpr uint8_t kBatteryAtStop = 0x80;

/// In addition to the flags of `reflex`: a power stage reports a fault, and nothing else stops the
/// robot.
constexpr uint8_t kStageTripped = 0x40;

/// What ended the last motion: the part that outlasts a reset. Saved as its bytes in memory, for
/// the same chip: so it has no padding.
struct LastStop {
  uint32_t held = 0;       ///< The sensors that held the robot, as flags of `held`.
  uint32_t session = 0;    ///< Whose setpoint drove until then,
  uint32_t command = 0;    ///< and its number.
  uint16_t faults = 0;     ///< Latched at it.
  uint16_t mmps = 0;       ///< Of the faster wheel.
  uint16_t rolled_mm = 0;  ///< Of that wheel, since.
  StopCause cause = StopCause::kUnknown;
  ResetReason reset = ResetReason::kUnknown;
  uint8_t flags = 0;  ///< Flags of `stopflag`.
  uint8_t unused[3]{};

  bool operator==(const LastStop& other) const { return memcmp(this, &other, kSize) == 0; }
  bool is_over() const { return (flags & stopflag::kAtRest) != 0; }

  static constexpr size_t kSize = 24;
};
static_assert(sizeof(LastStop) == LastStop::kSize);

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
  void encode(uint8_t* out, const LastStop& stop = {}) const {
    uint8_t* at = out;
    wire::put(at, kLatchMagic);
    wire::put(at,
              static_cast<uint8_t>((estop ? kEstopFlag : 0) | (battery_at_stop ? kBatteryFlag : 0) |
                                   (holds ? kHoldFlag : 0) | (moves ? kMovesFlag : 0)));
    wire::put(at, static_cast<uint8_t>(source));
    wire::put(at, faults);
    wire::put(at, driver);
    memcpy(at, &stop, LastStop::kSize);
    at += LastStop::kSize;
    wire::put(at, crc32(out, static_cast<size_t>(at - out)));
  }
  /// False if it is damaged, or not a record of latches.
  static bool decode(const uint8_t* data, size_t size, Latches& out, LastStop* stop = nullptr) {
    if (size != kSize || crc32(data, size) != kCrcResidue) return false;
    if (wire::take<uint16_t>(data) != kLatchMagic) return false;
    const auto flags = wire::take<uint8_t>(data);
    out.estop = (flags & kEstopFlag) != 0;
    out.holds = (flags & kHoldFlag) != 0;
    out.battery_at_stop = (flags & kBatteryFlag) != 0;
    out.moves = (flags & kMovesFlag) != 0;
    wire::get(data, out.source);
    wire::get(data, out.faults);
    wire::get(data, out.driver);
    if (stop != nullptr) memcpy(stop, data, LastStop::kSize);
    return true;
  }

 private:
  static constexpr uint16_t kLatchMagic = 0x4c57;  // "WL"
  static constexpr uint8_t kEstopFlag = 1;
  static constexpr uint8_t kBatteryFlag = 4;
  static constexpr uint8_t kHoldFlag = 8;
  static constexpr uint8_t kMovesFlag = 16;
};

/// Keeps the latches in memory that survives a reset of the processor, and an e-stop's also in
/// flash, since a power-on and the reset pin clear that memory.
class LatchKeeper {
 public:
  LatchKeeper(LatchMemory& memory, BlockStore& store) : memory_(memory), store_(store) {}

  /// What was latched before the reset. A record that cannot be read counts as an e-stop: it may
  /// have been one.
  Latches start() {
    uint8_t record[Latches::kSize];
    Latches stored;
    const size_t stored_size = store_.load(record, sizeof record);
    is_damaged_ =
        store_.faults() != 0 || (stored_size != 0 && !Latches::decode(record, stored_size, stored));
    is_stored_ = stored.estop;
    const size_t size = memory_.load(record, sizeof record);
    // Without one the power was off: only flash knows.
    if (size == 0 && is_stored_) latches_ = {.estop = true, .source = EstopSource::kBeforePowerOn};
    const bool is_whole = size == 0 || Latches::decode(record, size, latches_, &stop_);
    // A damaged record may be an e-stop until somebody clears it, even if the other record has
    // none.
    if ((is_damaged_ || !is_whole) && !latches_.estop) {
      latches_.estop = true;
      latches_.source = EstopSource::kDamagedRecord;
    }
    write_memory();
    return latches_;
  }
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
  bool sync_at_rest(uint64_t now_us) {
    if (latches_.estop == is_stored_ && !is_damaged_) return false;
    // A clear is written at once: what was cleared stays cleared.
    if (now_us < next_note_us_ && (latches_.estop || write_failed_)) return false;
    uint8_t record[Latches::kSize];
    Latches stored;
    stored.estop = latches_.estop;
    stored.encode(record);
    write_failed_ = !store_.save(record, sizeof record);
    if (!write_failed_) {
      is_stored_ = latches_.estop;
      is_damaged_ = false;
    }
    next_note_us_ = now_us + kNoteIntervalUs;
    return true;
  }
  /// Of the last write to flash.
  bool write_failed() const { return write_failed_; }

 private:
  /// Between two notes of an e-stop in flash, which wears: a contact may chatter for hours.
  static constexpr uint64_t kNoteIntervalUs = 10'000'000;

  void write_memory() {
    uint8_t record[Latches::kSize];
    latches_.encode(record, stop_);
    memory_.save(record, sizeof record);
  }

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
