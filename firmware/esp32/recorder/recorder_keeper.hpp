// When boxes and ledger go to flash: only while the wheels stand, one operation at a time, and not
// too often. A step that drives in between puts the rest off. After an operation that was longer
// than a control period the flash is left alone for as long as it took, so that a host is answered
// at least half of the time.
#pragma once

#include "black_box.hpp"
#include "box_store.hpp"
#include "device.hpp"
#include "ledger.hpp"

namespace wheelwire {

/// What records on a device of this identity.
BoxOrigin origin_of(const Identity& identity);

/// Memory that a reset of the processor does not change, if start-up code does not.
struct RecorderMemory {
  uint32_t box[box::kWords];
  uint8_t ledger[Ledger::kMemorySize];
};

class RecorderKeeper final : public BoxArchive {
 public:
  /// Of the partition `recorder`.
  static constexpr uint32_t kFlashSize = BoxStore::kSize + Ledger::kSize;
  static_assert(kFlashSize == 320 * 1024);

  /// `board`: fingerprint of the active one.
  RecorderKeeper(RecorderMemory& memory, FlashRegion& flash, const BoxOrigin& origin,
                 ResetReason reset_reason, uint32_t board)
      : store_(flash),
        ledger_(flash, BoxStore::kSize, memory.ledger),
        black_box_(memory.box, origin, &ledger_),
        memory_(memory.box),
        origin_(origin),
        reset_reason_(reset_reason),
        board_(board) {}
  RecorderKeeper(const RecorderKeeper&) = delete;
  RecorderKeeper& operator=(const RecorderKeeper&) = delete;

  /// Finds what is in flash, and what a reset left in memory. Call it once, before the first step.
  void start();
  /// Call after each control step.
  void step(Device& device, uint64_t now_us);

  void describe(BoxValue& value) const override;
  size_t read(uint32_t number, uint32_t offset, uint8_t* out, size_t capacity) override {
    return store_.read(number, offset, out, capacity);
  }
  void count(LedgerValue& value, uint64_t now_us) const override;

  BlackBox& black_box() { return black_box_; }
  BoxStore& store() { return store_; }

 private:
  /// Shortest time after a start, so that repeated dips of the supply, or a program that crashes at
  /// once, do not wear the flash.
  static constexpr uint64_t kAfterStartUs = 10'000'000;
  /// Three boxes at once, then one every ten minutes: flash wears.
  static constexpr uint64_t kBoxIntervalUs = 600'000'000;
  static constexpr uint32_t kBurst = 3;

  bool rests(const Device& device, uint64_t now_us);
  bool may_store(uint64_t now_us);
  void begin(const Device& device, uint64_t now_us);

  BoxStore store_;
  Ledger ledger_;
  BlackBox black_box_;
  uint32_t* memory_;
  BoxOrigin origin_;
  ResetReason reset_reason_;
  uint32_t board_;
  bool is_left_ = false;  // The box in memory is of the time before the reset.
  // Numbers of the box of the reset that began this boot, and of the box ended last; 0: none.
  uint32_t reset_number_ = 0;
  uint32_t ended_number_ = 0;
  bool stores_ = false;  // The box in memory is being stored.
  // When the flash was changed last, unless it is known how long that took; 0 otherwise.
  uint64_t changed_us_ = 0;
  uint64_t rest_until_us_ = 0;
  uint32_t allowed_ = kBurst;
  uint64_t refilled_us_ = 0;
};

}  // namespace wheelwire
