// Counts of what happened in a robot's life; they outlast a reset.
//
// Each write is an entry of its own, behind the others: the newest whole one counts, and a cut of
// the power leaves the one before it. What was counted since is in memory that a reset of the
// processor leaves alone: a crash loses no count, and at most a second of the running time.
#pragma once

#include <string.h>

#include "crc32.hpp"
#include "flash_region.hpp"
#include "protocol.hpp"
#include "supervisor.hpp"
#include "wire.hpp"

namespace wheelwire {

constexpr size_t kResetReasonCount = 8;

struct LedgerCounts {
  static constexpr size_t kSize = 128;

  uint32_t number = 0;    ///< Of the entry.
  uint32_t uptime_s = 0;  ///< In all.
  uint32_t resets[kResetReasonCount]{};
  /// Ends of DRIVING, faults and e-stops, by SupervisorEvent.
  uint32_t stops[kEventCount]{};

  void encode(uint8_t* out) const {
    uint8_t* at = out;
    wire::put(at, kMagic);
    wire::put(at, number);
    wire::put(at, uptime_s);
    for (const uint32_t count : resets) wire::put(at, count);
    for (const uint32_t count : stops) wire::put(at, count);
    wire::put(at, crc32(out, static_cast<size_t>(at - out)));
    while (at < out + kSize) *at++ = 0xff;
  }
  static bool decode(const uint8_t* bytes, LedgerCounts& out) {
    if (crc32(bytes, kUsedBytes) != kCrcResidue) return false;
    if (wire::take<uint32_t>(bytes) != kMagic) return false;
    wire::get(bytes, out.number);
    wire::get(bytes, out.uptime_s);
    for (uint32_t& count : out.resets) wire::get(bytes, count);
    for (uint32_t& count : out.stops) wire::get(bytes, count);
    return true;
  }

 private:
  static constexpr uint32_t kMagic = 0x4c425757;  // "WWBL"
  static constexpr size_t kUsedBytes = 12 + 4 * (kResetReasonCount + kEventCount) + 4;
  static_assert(kUsedBytes <= kSize);
};

class Ledger {
 public:
  static constexpr uint32_t kSize = 8 * kFlashSector;
  /// Two records, written one after the other: a reset in between leaves one whole.
  static constexpr size_t kMemorySize = 2 * LedgerCounts::kSize;

  /// In `flash`, kSize bytes from `offset` on.
  /// `memory`: kMemorySize bytes that start-up code leaves as they are. Their check decides whether
  /// the content is valid, never the reason for the reset.
  Ledger(FlashRegion& flash, uint32_t offset, uint8_t* memory)
      : flash_(flash), offset_(offset), memory_(memory) {}

  /// Finds the newest entry and what was counted since, and counts this start.
  void start(ResetReason reason) {
    find_newest();
    recall();
    const auto index = static_cast<size_t>(reason);
    ++counts_.resets[index < kResetReasonCount ? index : 0];
    is_changed_ = true;
    keep(0);
  }
  /// Counts a change of the supervisor's state.
  void count(SupervisorEvent event, SupervisorState before) {
    const bool is_stop = before == SupervisorState::kDriving || event == SupervisorEvent::kFault ||
                         event == SupervisorEvent::kEstop;
    if (!is_stop) return;
    ++counts_.stops[static_cast<size_t>(event)];
    is_changed_ = true;
    keep(kept_us_);
  }
  /// Call in each step: keeps the running time.
  void note_time(uint64_t now_us) {
    if (now_us - kept_us_ >= kKeepIntervalUs) keep(now_us);
  }
  /// Up to now.
  LedgerCounts counts(uint64_t now_us) const {
    LedgerCounts present = counts_;
    present.uptime_s += static_cast<uint32_t>(now_us / 1'000'000);
    return present;
  }
  /// Call at rest: one operation, if there is something to write, every ten minutes at most.
  bool work(uint64_t now_us) {
    if (!is_changed_ || now_us < due_us_) return false;
    uint8_t bytes[LedgerCounts::kSize];
    // The remains of a power cut are skipped; at the start of a sector they are erased.
    if (!is_blank(flash_, offset_of(next_), bytes, sizeof bytes)) {
      if (offset_of(next_) % kFlashSector == 0) return flash_.erase(offset_of(next_)), true;
      next_ = (next_ + 1) % kEntries;
      return false;
    }
    LedgerCounts written = counts(now_us);
    ++written.number;
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

 private:
  static constexpr uint64_t kIntervalUs = 600'000'000;
  static constexpr uint64_t kKeepIntervalUs = 1'000'000;
  static constexpr uint32_t kEntries = kSize / LedgerCounts::kSize;

  void find_newest() {
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
  void recall() {
    for (size_t i = 0; i < kMemorySize; i += LedgerCounts::kSize) {
      LedgerCounts kept;
      if (!LedgerCounts::decode(memory_ + i, kept)) continue;
      if (kept.number == counts_.number) counts_ = kept;
      return;
    }
  }
  void keep(uint64_t now_us) {
    kept_us_ = now_us;
    uint8_t bytes[LedgerCounts::kSize];
    counts(now_us).encode(bytes);
    for (size_t i = 0; i < kMemorySize; i += sizeof bytes) {
      memcpy(memory_ + i, bytes, sizeof bytes);
      // The compiler must not write both at once.
      __atomic_signal_fence(__ATOMIC_SEQ_CST);
    }
  }
  uint32_t offset_of(uint32_t entry) const {
    return offset_ + entry * static_cast<uint32_t>(LedgerCounts::kSize);
  }

  FlashRegion& flash_;
  uint32_t offset_;
  uint8_t* memory_;
  uint64_t kept_us_ = 0;  // When the memory was written.
  uint32_t next_ = 0;     // Entry to be written.
  LedgerCounts counts_;
  bool is_changed_ = false;
  uint64_t due_us_ = 0;
};

}  // namespace wheelwire
