// When boxes and ledger go to flash: only while the wheels stand, one operation at a time, and not
// too often. A step that drives in between puts the rest off. After an operation that was longer
// than a control period the flash is left alone for as long as it took, so that a host is answered
// at least half of the time.
#pragma once

#include "black_box.hpp"
#include "box_store.hpp"
#include "core_hash.hpp"
#include "device.hpp"
#include "ledger.hpp"

namespace wheelwire {

/// What records on a device of this identity.
inline BoxOrigin origin_of(const Identity& identity) {
  return {.core = kCoreHash,
          .release = static_cast<uint32_t>(identity.version_major << 16 |
                                           identity.version_minor << 8 | identity.version_patch),
          .git_hash = identity.git_hash,
          .boot_id = identity.boot_id};
}

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
  void start() {
    store_.start();
    ledger_.start(reset_reason_);
    uint32_t boot_id;
    is_left_ = leaves_a_box(reset_reason_) && black_box_.keep_what_is_left(boot_id);
    if (is_left_) {
      origin_.boot_id = boot_id;
    } else {
      black_box_.clear();
    }
  }
  /// Call after each control step.
  void step(Device& device, uint64_t now_us) {
    ledger_.note_time(now_us);
    if (rests(device, now_us) || now_us < kAfterStartUs || !device.is_at_rest(now_us)) return;
    if (stores_ && !store_.is_storing()) {
      // It is stored, or the flash takes nothing.
      stores_ = is_left_ = false;
      black_box_.clear();
    }
    if (black_box_.is_closed() && !stores_ && may_store(now_us)) begin(device, now_us);
    if (!(store_.is_idle() ? ledger_.work(now_us) : store_.work())) return;
    changed_us_ = now_us;
    device.note_stall();
  }

  void describe(BoxValue& value) const override {
    value.box_count = static_cast<uint8_t>(store_.count());
    const BoxHead* const head = store_.head(value.age);
    if (head == nullptr) return;
    value.number = head->number;
    const bool is_ended = black_box_.is_current() && !black_box_.is_triggered();
    value.is_current =
        value.number == reset_number_ || (is_ended && value.number == ended_number_) ? 1 : 0;
    value.size = kBoxImageSize;
    value.cause = head->cause;
    value.reset_reason = head->reset_reason;
    value.boot_id = head->origin.boot_id;
    value.core = head->origin.core;
    value.release = head->origin.release;
    value.git_hash = head->origin.git_hash;
    value.board = head->board;
    value.faults = head->faults;
    value.stored_us = head->stored_us;
  }
  size_t read(uint32_t number, uint32_t offset, uint8_t* out, size_t capacity) override {
    return store_.read(number, offset, out, capacity);
  }
  void count(LedgerValue& value, uint64_t now_us) const override {
    const LedgerCounts counts = ledger_.counts(now_us);
    const auto resets = [&](ResetReason reason) {
      return counts.resets[static_cast<size_t>(reason)];
    };
    const auto stops = [&](SupervisorEvent event) {
      return counts.stops[static_cast<size_t>(event)];
    };
    value.uptime_s = counts.uptime_s;
    value.resets_unknown = resets(ResetReason::kUnknown);
    value.resets_power_on = resets(ResetReason::kPowerOn);
    value.resets_external = resets(ResetReason::kExternal);
    value.resets_software = resets(ResetReason::kSoftware);
    value.resets_panic = resets(ResetReason::kPanic);
    value.resets_task_watchdog = resets(ResetReason::kTaskWatchdog);
    value.resets_interrupt_watchdog = resets(ResetReason::kInterruptWatchdog);
    value.resets_brownout = resets(ResetReason::kBrownout);
    value.stops_session = stops(SupervisorEvent::kSession);
    value.stops_stop = stops(SupervisorEvent::kStop);
    value.stops_deadline = stops(SupervisorEvent::kDeadline);
    value.stops_estop = stops(SupervisorEvent::kEstop);
    value.stops_fault = stops(SupervisorEvent::kFault);
  }

  BlackBox& black_box() { return black_box_; }
  BoxStore& store() { return store_; }

 private:
  /// Shortest time after a start, so that repeated dips of the supply, or a program that crashes at
  /// once, do not wear the flash.
  static constexpr uint64_t kAfterStartUs = 10'000'000;
  /// Three boxes at once, then one every ten minutes: flash wears.
  static constexpr uint64_t kBoxIntervalUs = 600'000'000;
  static constexpr uint32_t kBurst = 3;

  /// Whether the memory still holds what was recorded, and the reset is one that a box explains.
  static bool leaves_a_box(ResetReason reason) {
    return reason == ResetReason::kPanic || reason == ResetReason::kTaskWatchdog ||
           reason == ResetReason::kInterruptWatchdog;
  }

  /// How long an operation takes only the chip knows: it is over when the next step begins.
  bool rests(const Device& device, uint64_t now_us) {
    if (changed_us_ != 0) {
      const uint64_t took_us = now_us - changed_us_;
      changed_us_ = 0;
      if (took_us > device.control_period_us()) rest_until_us_ = now_us + took_us;
    }
    return now_us < rest_until_us_;
  }
  bool may_store(uint64_t now_us) {
    while (allowed_ < kBurst && now_us - refilled_us_ >= kBoxIntervalUs) {
      ++allowed_;
      refilled_us_ += kBoxIntervalUs;
    }
    if (allowed_ == kBurst) refilled_us_ = now_us;
    if (allowed_ == 0) return false;
    --allowed_;
    return true;
  }
  void begin(const Device& device, uint64_t now_us) {
    BoxHead head{.reset_reason = reset_reason_,
                 .origin = origin_,
                 .board = board_,
                 .faults = device.faults(),
                 .stored_us = now_us};
    head.cause = is_left_ ? BoxCause::kReset : black_box_.cause();
    (is_left_ ? reset_number_ : ended_number_) = store_.begin(head, memory_);
    stores_ = true;
  }

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
