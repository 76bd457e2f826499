// Which list of peripherals is active: see `TrialStore`. A list is bound to its board: on another
// one its pins would mean something else, and a robot that was protected would silently be so no
// more. So nothing drives before a list of the board's own is confirmed, be it an empty one.
#pragma once

#include "peripherals.hpp"
#include "trial_store.hpp"

namespace wheelwire {

class PeripheralKeeper {
 public:
  /// `built_in`: active while none is stored, on the board that it names, as the simulated robot's
  /// own; nullptr: there is none.
  explicit PeripheralKeeper(ParameterStore& store, const PeripheralList* built_in = nullptr)
      : store_(store), built_in_(built_in) {}

  /// Decides which list is active until the next start. `board`: the active one, confirmed or on
  /// trial; nullptr: there is none, and nothing is measured.
  void start(const BoardDescription* board);

  PeripheralsState state() const { return state_; }
  /// Whether its peripherals are read, and their reflexes act.
  bool is_active() const {
    return state_ == PeripheralsState::kStored || state_ == PeripheralsState::kTrial;
  }
  /// Empty unless it is active.
  const PeripheralList& list() const { return list_; }
  /// Of the active list; 0 if there is none.
  uint32_t fingerprint() const { return fingerprint_; }
  /// Why nothing may drive; kNone if it may.
  RefusalCode refusal() const;

  bool is_overdue(uint64_t since_start_us) const {
    return state_ == PeripheralsState::kTrial && since_start_us >= kStoreTrialUs;
  }

  // Each returns kNone, or why it was refused.
  /// Sets an entry of the list that the next `write` stores.
  RefusalCode set(size_t channel, const uint8_t* packed);
  /// Stores the first `count` entries that were set, to be tried if a restart is asked for in this
  /// session. Whether they fit the board is for the start to find out.
  RefusalCode write(uint8_t count, uint32_t board, uint32_t fingerprint);
  RefusalCode confirm(uint32_t fingerprint);
  RefusalCode request_trial() { return store_.request_trial(); }

  bool has_candidate() const { return store_.has_candidate(); }
  /// A new session: what the previous one wrote and did not restart for is not tried.
  void drop_candidate();

  /// See SensorMessages: where the list is from, its fingerprint, and the entries that were set.
  static constexpr size_t kEntryWords = Peripheral::kSize / sizeof(uint32_t);
  static constexpr size_t kStateWords = 2 + kMostPeripherals * kEntryWords;
  uint32_t state_word(size_t index) const;
  void set_state_word(size_t index, uint32_t word);

 private:
  PeripheralList staged(uint8_t count, uint32_t board) const;
  void take(const PeripheralList& list, PeripheralsState state);

  TrialStore<PeripheralList::kSize> store_;
  const PeripheralList* built_in_;
  PeripheralsState state_ = PeripheralsState::kEmpty;
  uint32_t fingerprint_ = 0;
  PeripheralList list_;
  uint32_t staged_[kMostPeripherals * kEntryWords]{};  // Packed entries.
};

}  // namespace wheelwire
