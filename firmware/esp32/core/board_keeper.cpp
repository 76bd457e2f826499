#include "board_keeper.hpp"

namespace wheelwire {

void BoardKeeper::start() {
  const uint8_t* packed = nullptr;
  const auto is_usable = [this](const uint8_t* candidate) {
    BoardDescription board;
    return read(candidate, board);
  };
  switch (store_.start(is_usable, packed)) {
    case BoardStore::Found::kNothing:
      return take_built_in();
    case BoardStore::Found::kUnreadable:
      return;  // Nothing is known of the wiring, so nothing is driven.
    case BoardStore::Found::kConfirmed:
      return take(packed, BoardState::kStored);
    case BoardStore::Found::kTrial:
      return take(packed, BoardState::kTrial);
  }
}

RefusalCode BoardKeeper::write(const uint8_t* packed) {
  if (on_trial()) return RefusalCode::kBoardOnTrial;
  BoardDescription board;
  return read(packed, board) ? store_.write(packed) : RefusalCode::kBoardRefused;
}

RefusalCode BoardKeeper::confirm(uint32_t fingerprint) {
  if (!on_trial() && state_ != BoardState::kBuiltIn) return RefusalCode::kNoBoardOnTrial;
  if (fingerprint != fingerprint_) return RefusalCode::kBoardRefused;
  uint8_t packed[BoardDescription::kSize];
  write_board(board_, packed);
  const RefusalCode refusal = store_.confirm(packed);
  // The image's own board gets its pins at the next start, as any board does.
  if (refusal == RefusalCode::kNone && on_trial()) state_ = BoardState::kStored;
  return refusal;
}

/// False if this device cannot use it.
bool BoardKeeper::read(const uint8_t* packed, BoardDescription& board) const {
  return read_board(packed, BoardDescription::kSize, board) == BoardFault::kNone &&
         board.chip == chip_ && first_issue(board).fault == BoardFault::kNone;
}

void BoardKeeper::take(const uint8_t* packed, BoardState state) {
  BoardDescription board;
  if (!read(packed, board)) return;
  board_ = board;
  fingerprint_ = wheelwire::fingerprint(board);
  state_ = state;
}

void BoardKeeper::take_built_in() {
  if (built_in_ == nullptr) return;
  board_ = *built_in_;
  fingerprint_ = wheelwire::fingerprint(board_);
  state_ = confirmation_ == BuiltIn::kConfirmed ? BoardState::kStored : BoardState::kBuiltIn;
}

void apply_board(const BoardDescription& board, ParameterSpec* specs) {
  const auto set = [specs](ParameterId id, float value) {
    specs[static_cast<size_t>(id) - 1].default_value = value;
  };
  set(ParameterId::kPwmFrequencyHz, board.pwm_frequency_hz);
  set(ParameterId::kGlitchFilterNs, board.encoder_filter_ns);
  if (board.estop < 0) set(ParameterId::kEstopInputEnabled, 0);
}

}  // namespace wheelwire
