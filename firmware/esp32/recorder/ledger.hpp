// What happened to a robot in its life, as counts that outlive a reset.
//
// Each write is an entry of its own, behind the others: the newest whole one counts, and a cut of
// the power leaves the one before it.
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

  /// In `flash`, kSize bytes from `offset` on.
  Ledger(FlashRegion& flash, uint32_t offset) : flash_(flash), offset_(offset) {}

  /// Finds the newest entry, and counts this start.
  void start(ResetReason reason);
  /// Counts a change of the supervisor's state.
  void count(SupervisorEvent event, SupervisorState before);
  /// Up to now.
  LedgerCounts counts(uint64_t now_us) const;
  /// Call at rest: one operation, if there is something to write, every ten minutes at most.
  bool work(uint64_t now_us);

 private:
  static constexpr uint64_t kIntervalUs = 600'000'000;
  static constexpr uint32_t kEntries = kSize / LedgerCounts::kSize;

  bool is_blank(uint32_t entry);
  uint32_t offset_of(uint32_t entry) const {
    return offset_ + entry * static_cast<uint32_t>(LedgerCounts::kSize);
  }

  FlashRegion& flash_;
  uint32_t offset_;
  uint32_t next_ = 0;  // Entry to be written.
  LedgerCounts counts_;
  bool is_changed_ = false;
  uint64_t due_us_ = 0;
};

}  // namespace wheelwire
