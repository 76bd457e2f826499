#include "latches.hpp"

#include "crc32.hpp"
#include "wire.hpp"

namespace wheelwire {
namespace {

constexpr uint16_t kLatchMagic = 0x4c57;  // "WL"
constexpr uint8_t kEstopFlag = 1;
constexpr uint8_t kBatteryFlag = 4;
constexpr uint8_t kHoldFlag = 8;
constexpr uint8_t kMovesFlag = 16;

}  // namespace

void Latches::encode(uint8_t* out, const LastStop& stop) const {
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

bool Latches::decode(const uint8_t* data, size_t size, Latches& out, LastStop* stop) {
  if (size != kSize || crc32(data, size) != kCrcResidue) return false;
  uint16_t magic;
  uint8_t flags;
  uint8_t source;
  wire::get(data, magic);
  wire::get(data, flags);
  wire::get(data, source);
  if (magic != kLatchMagic) return false;
  out.estop = (flags & kEstopFlag) != 0;
  out.holds = (flags & kHoldFlag) != 0;
  out.battery_at_stop = (flags & kBatteryFlag) != 0;
  out.moves = (flags & kMovesFlag) != 0;
  out.source = static_cast<EstopSource>(source);
  wire::get(data, out.faults);
  wire::get(data, out.driver);
  if (stop != nullptr) memcpy(stop, data, LastStop::kSize);
  return true;
}

Latches LatchKeeper::start() {
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
  // A damaged record may be an e-stop until somebody clears it, even if the other record has none.
  if ((is_damaged_ || !is_whole) && !latches_.estop) {
    latches_.estop = true;
    latches_.source = EstopSource::kDamagedRecord;
  }
  write_memory();
  return latches_;
}

bool LatchKeeper::sync_at_rest(uint64_t now_us) {
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

void LatchKeeper::write_memory() {
  uint8_t record[Latches::kSize];
  latches_.encode(record, stop_);
  memory_.save(record, sizeof record);
}

}  // namespace wheelwire
