// The black box: a ring in memory with the device's inputs of the last second or two, and the
// results. A re-run computes the same again from it. See box_format.hpp.
#pragma once

#include "box_format.hpp"
#include "recorder.hpp"

namespace wheelwire {

/// The build that records: only the same core can re-run a box.
struct BoxOrigin {
  uint32_t core;      ///< `kCoreHash`
  uint32_t release;   ///< major << 16 | minor << 8 | patch
  uint32_t git_hash;  ///< 0: not known.
  uint32_t boot_id;
};

class Ledger;

class BlackBox final : public Recorder {
 public:
  /// `memory`, of box::kWords words, does not change before the first step: it may hold the box
  /// from before a reset. `ledger`: counts what stops the robot; may be nullptr.
  BlackBox(uint32_t* memory, const BoxOrigin& origin, Ledger* ledger = nullptr)
      : memory_(memory), origin_(origin), ledger_(ledger) {}

  /// Whether the memory has records from before a reset, and of which boot. If so, nothing is
  /// recorded before `clear`.
  bool keep_what_is_left(uint32_t& boot_id);
  /// Starts again, and loses what was recorded before.
  void clear();
  /// Ends the box: nothing more is recorded before `clear`.
  void close() {
    at_ = limit_ = end_ = 0;
    closed_ = true;
  }
  bool is_closed() const { return closed_; }
  /// Whether a fault or an emergency stop has ended it, which the next step does.
  bool is_triggered() const { return triggered_; }
  /// Whether the state that ended a box has not changed since.
  bool is_current() const { return is_current_; }
  /// What ended it.
  BoxCause cause() const { return cause_; }
  /// How many segments were begun.
  uint32_t segments() const { return number_; }

  void note_state(MessageServer& server, Robot& robot) override;
  void note_step(const StepNote& note) override;
  void note_message(uint8_t id, const uint8_t* body, size_t size, uint64_t now_us) override;
  void note_hang_up(uint64_t now_us) override {
    put(box::Kind::kHangUp, 0, low(now_us), high(now_us));
  }
  void note_failure(uint32_t faults) override { put(box::Kind::kFailure, 0, faults); }
  void note_stall() override { put(box::Kind::kStall, 0); }
  void note_reflexes(uint8_t reflexes) override { put(box::Kind::kReflexes, 1, reflexes); }
  void note_contact(bool open) override;
  void note_store(bool done, uint32_t faults) override {
    put(box::Kind::kStore, done ? 1 : 0, faults);
  }
  void note_parameters(Parameters& parameters, ControlConfig& config,
                       uint32_t& contradictions) override;
  void note_transition(SupervisorEvent event, SupervisorState before, SupervisorState after,
                       uint32_t faults) override;
  void note_refusal(uint8_t message_id, RefusalCode code) override {
    put(box::Kind::kRefusal, 0, message_id | static_cast<uint32_t>(code) << 8);
  }

 private:
  /// Left in a segment when the state is wanted: for a step, and what comes of it.
  static constexpr uint32_t kReserveWords = 180;

  static constexpr uint32_t low(uint64_t value) { return static_cast<uint32_t>(value); }
  static constexpr uint32_t high(uint64_t value) { return static_cast<uint32_t>(value >> 32); }

  /// Room for a record's payload; nullptr: there is none, as before the first segment.
  uint32_t* begin(size_t words) { return at_ + words < end_ ? memory_ + at_ + 1 : nullptr; }
  /// The payload is written: the word before it makes it a record.
  void commit(box::Kind kind, uint32_t argument, size_t words) {
    uint32_t* const record = memory_ + at_;
    const uint32_t info = box::info(kind, argument);
    uint32_t check = box::mix(check_, info);
    for (size_t i = 1; i <= words; ++i) check = box::mix(check, record[i]);
    record[0] = info | (check & 0xffff0000u);
    check_ = check;
    at_ += static_cast<uint32_t>(words) + 1;
    reads_ = 0;
  }
  /// Writes a record with these words, if there is room.
  template <typename... Words>
  bool put(box::Kind kind, uint32_t argument, Words... words) {
    uint32_t* out = begin(sizeof...(words));
    if (out == nullptr) return false;
    ((*out++ = words), ...);
    commit(kind, argument, sizeof...(words));
    return true;
  }
  void begin_segment();
  void note_wide_step(const StepNote& note);

  uint32_t* memory_;
  BoxOrigin origin_;
  Ledger* ledger_;
  uint32_t end_ = 0;     // Of the segment; 0: there is none.
  uint32_t number_ = 0;  // Of the segment.
  uint32_t check_ = 0;
  uint32_t reads_ = 0;  // Of the contact, since the last record.
  bool open_ = false;
  bool is_first_ = true;  // The next step has no earlier one to be compared with.
  bool triggered_ = false;
  bool closed_ = false;
  bool is_current_ = false;  // For the newest ended box, even once it is stored.
  BoxCause cause_ = BoxCause::kRequest;
  StepNote last_{};
};

}  // namespace wheelwire
