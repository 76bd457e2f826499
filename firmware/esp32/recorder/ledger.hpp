// Counts of what happened in a robot's life; they outlast a reset.
//
// Each write is an entry of its own, behind the others: the newest whole one counts, and a cut of
// the power leaves the one before it. What was counted since is in memory that a reset of the
// processor leaves alone: a crash loses no count, and at most a second of the running time.
#pragma once

#include "flash_region.hpp"
#include "protocol.hpp"
#include "supervisor.hpp"

namespace wheelwire {

constexpr size_t kResetReasonCount = 8;

struct LedgerCounts {
  static constexpr size_t kSize = 128;

  uint32_t number = 0;    ///< Of the entry.
  uint32_t uptime_s = 0;  ///< In all.
  uint32_t resets[kResetReasonCount]{};
  /// Ends of DRIVING, faults and e-stops, by SupervisorEvent.
  uint32_t stops[kEventCount]{};

  void encode(uint8_t* out) const;
  static bool decode(const uint8_t* bytes, LedgerCounts& out);
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
  void start(ResetReason reason);
  /// Counts a change of the supervisor's state.
  void count(SupervisorEvent event, SupervisorState before);
  /// Call in each step: keeps the running time.
  void note_time(uint64_t now_us) {
    if (now_us - kept_us_ >= kKeepIntervalUs) keep(now_us);
  }
  /// Up to now.
  LedgerCounts counts(uint64_t now_us) const;
  /// Call at rest: one operation, if there is something to write, every ten minutes at most.
  bool work(uint64_t now_us);

 private:
  static constexpr uint64_t kIntervalUs = 600'000'000;
  static constexpr uint64_t kKeepIntervalUs = 1'000'000;
  static constexpr uint32_t kEntries = kSize / LedgerCounts::kSize;

  void find_newest();
  void recall();
  void keep(uint64_t now_us);
  bool is_blank(uint32_t entry);
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
