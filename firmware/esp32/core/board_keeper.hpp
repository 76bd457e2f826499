// Which board is active: see `TrialStore`. Nothing is driven on a board that nobody confirmed.
#pragma once

#include "board_rules.hpp"
#include "trial_store.hpp"

namespace wheelwire {

using BoardStore = TrialStore<BoardDescription::kSize>;

/// Whether somebody said that this is the board, at least for a trial. Otherwise no pin is driven,
/// and what the board's inputs read means nothing.
constexpr bool is_confirmed(BoardState state) {
  return state == BoardState::kStored || state == BoardState::kTrial;
}

class BoardKeeper {
 public:
  /// What becomes of the image's own board while none is stored.
  enum class BuiltIn : uint8_t { kUnconfirmed, kConfirmed };

  /// `chip`: a board for another one is refused. `built_in`: the image's own, active while none is
  /// stored; nullptr: there is none. A simulated robot has the board that it says, so that board is
  /// confirmed from the start.
  BoardKeeper(ParameterStore& store, Chip chip, const BoardDescription* built_in,
              BuiltIn confirmation = BuiltIn::kUnconfirmed)
      : store_(store), chip_(chip), built_in_(built_in), confirmation_(confirmation) {}

  /// Decides which board is active until the next start. Call it once, before any pin is touched.
  void start();

  BoardState state() const { return state_; }
  bool is_confirmed() const { return wheelwire::is_confirmed(state_); }
  /// Of the active board; 0 if there is none.
  uint32_t fingerprint() const { return fingerprint_; }
  /// Of BoardState::kNone it has no meaning.
  const BoardDescription& board() const { return board_; }

  bool on_trial() const { return state_ == BoardState::kTrial; }
  /// Whether a trial was not confirmed in time.
  bool is_overdue(uint64_t since_start_us) const {
    return on_trial() && since_start_us >= kStoreTrialUs;
  }

  // Each returns kNone, or why it was refused.
  /// Stores a packed board, to be tried if a restart is asked for in this session.
  RefusalCode write(const uint8_t* packed);
  /// Saves the board that is on trial, or the image's own, which drives from the next start on.
  RefusalCode confirm(uint32_t fingerprint);
  /// A restart was asked for: a board that was written in this session is tried.
  RefusalCode request_trial() { return store_.request_trial(); }

  /// Whether a restart would try another board.
  bool has_candidate() const { return store_.has_candidate(); }
  /// A new session: what the previous one wrote and did not restart for is not tried.
  void drop_candidate() { store_.drop_candidate(); }

  template <typename Visitor>
  void visit(Visitor& visit) {
    visit("chip", chip_);
    visit("state", state_);
    bool is_fresh = store_.has_candidate();
    visit("is_fresh", is_fresh);
    store_.restore_candidate(is_fresh);
    visit("fingerprint", fingerprint_);
  }

 private:
  bool read(const uint8_t* packed, BoardDescription& board) const;
  void take(const uint8_t* packed, BoardState state);
  void take_built_in();

  BoardStore store_;
  Chip chip_;
  const BoardDescription* built_in_;
  BuiltIn confirmation_;
  uint32_t fingerprint_ = 0;
  BoardDescription board_;
  BoardState state_ = BoardState::kNone;
};

/// Makes what the board says the parameters' defaults, in `specs`, kParameterCount rows.
void apply_board(const BoardDescription& board, ParameterSpec* specs);

}  // namespace wheelwire
