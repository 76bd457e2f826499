// Which board is in force. A board that was written is tried at the next start, and kept only if
// the host confirms it; otherwise the former one returns.
#pragma once

#include "board_rules.hpp"
#include "hal.hpp"

namespace wheelwire {

/// Within this after the start a board on trial is confirmed, or the device restarts with the
/// former one.
constexpr uint64_t kBoardTrialUs = 10'000'000;

/// What the store holds: both boards and how far the trial is, replaced as a whole. So a cut of the
/// power leaves what was before a write, or what is after it.
struct BoardBlock {
  enum class Candidate : uint8_t { kNone, kWritten, kTried };

  static constexpr uint8_t kFormat = 1;
  static constexpr size_t kHeaderSize = 4;
  static constexpr size_t kSize = kHeaderSize + 2 * BoardDescription::kSize + 4;

  Candidate candidate_state = Candidate::kNone;
  bool has_confirmed = false;
  uint8_t confirmed[BoardDescription::kSize]{};
  uint8_t candidate[BoardDescription::kSize]{};

  void encode(uint8_t* out) const;
  /// False if it is damaged, or of another format.
  static bool decode(const uint8_t* data, size_t size, BoardBlock& out);
};

class BoardKeeper {
 public:
  /// `chip`: a board for another one is refused; kSimulated takes any. `built_in`: in force while
  /// none is stored; nullptr: there is none.
  BoardKeeper(ParameterStore& store, Board chip, const BoardDescription* built_in)
      : store_(store), chip_(chip), built_in_(built_in) {}

  /// Decides which board is in force until the next start. Call it once, before any pin is touched.
  void start();

  BoardState state() const { return state_; }
  /// Of BoardState::kNone it has no meaning.
  const BoardDescription& board() const { return board_; }

  bool on_trial() const { return state_ == BoardState::kTrial; }
  /// Whether a trial was not confirmed in time.
  bool is_overdue(uint64_t since_start_us) const {
    return on_trial() && since_start_us >= kBoardTrialUs;
  }

  // Each returns kNone, or why it was refused.
  /// Stores a packed board, to be tried at the next start.
  RefusalCode write(const uint8_t* packed);
  /// Keeps the board that is on trial.
  RefusalCode confirm();

 private:
  bool take(const uint8_t* packed, BoardState state);
  bool fits(const BoardDescription& board) const;
  bool save();

  ParameterStore& store_;
  Board chip_;
  const BoardDescription* built_in_;
  BoardBlock block_;
  BoardDescription board_;
  BoardState state_ = BoardState::kNone;
};

/// Makes what the board says the parameters' defaults, in `specs`, kParameterCount rows.
void apply_board(const BoardDescription& board, ParameterSpec* specs);

}  // namespace wheelwire
