#include "ledger.hpp"

#include <string.h>

#include "crc32.hpp"
#include "wire.hpp"

namespace wheelwire {
namespace {

constexpr uint32_t kMagic = 0x4c425757;  // "WWBL"
constexpr size_t kUsedBytes = 12 + 4 * (kResetReasonCount + kEventCount) + 4;
static_assert(kUsedBytes <= LedgerCounts::kSize);

}  // namespace

void LedgerCounts::encode(uint8_t* out) const {
  uint8_t* at = out;
  wire::put(at, kMagic);
  wire::put(at, number);
  wire::put(at, uptime_s);
  for (const uint32_t count : resets) wire::put(at, count);
  for (const uint32_t count : stops) wire::put(at, count);
  wire::put(at, crc32(out, static_cast<size_t>(at - out)));
  while (at < out + kSize) *at++ = 0xff;
}

bool LedgerCounts::decode(const uint8_t* bytes, LedgerCounts& out) {
  if (crc32(bytes, kUsedBytes) != kCrcResidue) return false;
  uint32_t magic;
  wire::get(bytes, magic);
  if (magic != kMagic) return false;
  wire::get(bytes, out.number);
  wire::get(bytes, out.uptime_s);
  for (uint32_t& count : out.resets) wire::get(bytes, count);
  for (uint32_t& count : out.stops) wire::get(bytes, count);
  return true;
}

void Ledger::start(ResetReason reason) {
  find_newest();
  recall();
  const auto index = static_cast<size_t>(reason);
  ++counts_.resets[index < kResetReasonCount ? index : 0];
  is_changed_ = true;
  keep(0);
}

void Ledger::find_newest() {
  uint8_t bytes[LedgerCounts::kSize];
  bool is_found = false;
  for (uint32_t entry = 0; entry < kEntries; ++entry) {
    LedgerCounts read;
    if (!flash_.read(offset_of(entry), bytes, sizeof bytes)) continue;
    if (!LedgerCounts::decode(bytes, read)) continue;
    if (is_found && static_cast<int32_t>(read.number - counts_.number) <= 0) continue;
    is_found = true;
    counts_ = read;
    next_ = (entry + 1) % kEntries;
  }
}

/// What is of another entry was counted before it, or is of another flash.
void Ledger::recall() {
  for (size_t i = 0; i < kMemorySize; i += LedgerCounts::kSize) {
    LedgerCounts kept;
    if (!LedgerCounts::decode(memory_ + i, kept)) continue;
    if (kept.number == counts_.number) counts_ = kept;
    return;
  }
}

void Ledger::keep(uint64_t now_us) {
  kept_us_ = now_us;
  uint8_t bytes[LedgerCounts::kSize];
  counts(now_us).encode(bytes);
  for (size_t i = 0; i < kMemorySize; i += sizeof bytes) {
    memcpy(memory_ + i, bytes, sizeof bytes);
    // The compiler must not write both at once.
    __atomic_signal_fence(__ATOMIC_SEQ_CST);
  }
}

void Ledger::count(SupervisorEvent event, SupervisorState before) {
  const bool is_stop = before == SupervisorState::kDriving || event == SupervisorEvent::kFault ||
                       event == SupervisorEvent::kEstop;
  if (!is_stop) return;
  ++counts_.stops[static_cast<size_t>(event)];
  is_changed_ = true;
  keep(kept_us_);
}

LedgerCounts Ledger::counts(uint64_t now_us) const {
  LedgerCounts present = counts_;
  present.uptime_s += static_cast<uint32_t>(now_us / 1'000'000);
  return present;
}

bool Ledger::work(uint64_t now_us) {
  if (!is_changed_ || now_us < due_us_) return false;
  // The remains of a power cut are skipped; at the start of a sector they are erased.
  if (!is_blank(next_)) {
    if (offset_of(next_) % kFlashSector == 0) return flash_.erase(offset_of(next_)), true;
    next_ = (next_ + 1) % kEntries;
    return false;
  }
  LedgerCounts written = counts(now_us);
  ++written.number;
  uint8_t bytes[LedgerCounts::kSize];
  written.encode(bytes);
  due_us_ = now_us + kIntervalUs;
  if (flash_.write(offset_of(next_), bytes, sizeof bytes)) {
    counts_.number = written.number;
    is_changed_ = false;
    keep(now_us);
  }
  next_ = (next_ + 1) % kEntries;
  return true;
}

bool Ledger::is_blank(uint32_t entry) {
  uint8_t bytes[LedgerCounts::kSize];
  if (!flash_.read(offset_of(entry), bytes, sizeof bytes)) return false;
  for (const uint8_t byte : bytes)
    if (byte != 0xff) return false;
  return true;
}

}  // namespace wheelwire
