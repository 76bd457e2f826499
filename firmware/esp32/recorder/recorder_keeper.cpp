#include "recorder_keeper.hpp"

#include "core_hash.hpp"

namespace wheelwire {
namespace {

/// Whether the memory still holds what was recorded, and the reset is one that a box explains.
bool leaves_a_box(ResetReason reason) {
  return reason == ResetReason::kPanic || reason == ResetReason::kTaskWatchdog ||
         reason == ResetReason::kInterruptWatchdog;
}

}  // namespace

BoxOrigin origin_of(const Identity& identity) {
  return {.core = kCoreHash,
          .release = static_cast<uint32_t>(identity.version_major << 16 |
                                           identity.version_minor << 8 | identity.version_patch),
          .git_hash = identity.git_hash,
          .boot_id = identity.boot_id};
}

void RecorderKeeper::start() {
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

void RecorderKeeper::step(Device& device, uint64_t now_us) {
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

/// How long an operation takes only the chip knows: it is over when the next step begins.
bool RecorderKeeper::rests(const Device& device, uint64_t now_us) {
  if (changed_us_ != 0) {
    const uint64_t took_us = now_us - changed_us_;
    changed_us_ = 0;
    if (took_us > device.control_period_us()) rest_until_us_ = now_us + took_us;
  }
  return now_us < rest_until_us_;
}

bool RecorderKeeper::may_store(uint64_t now_us) {
  while (allowed_ < kBurst && now_us - refilled_us_ >= kBoxIntervalUs) {
    ++allowed_;
    refilled_us_ += kBoxIntervalUs;
  }
  if (allowed_ == kBurst) refilled_us_ = now_us;
  if (allowed_ == 0) return false;
  --allowed_;
  return true;
}

void RecorderKeeper::describe(BoxValue& value) const {
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

void RecorderKeeper::count(LedgerValue& value, uint64_t now_us) const {
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

void RecorderKeeper::begin(const Device& device, uint64_t now_us) {
  BoxHead head{.reset_reason = reset_reason_,
               .origin = origin_,
               .board = board_,
               .faults = device.faults(),
               .stored_us = now_us};
  head.cause = is_left_ ? BoxCause::kReset : black_box_.cause();
  (is_left_ ? reset_number_ : ended_number_) = store_.begin(head, memory_);
  stores_ = true;
}

}  // namespace wheelwire
