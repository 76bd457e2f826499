#include "board_keeper.hpp"

#include <string.h>

#include "crc32.hpp"

namespace wheelwire {

void BoardBlock::encode(uint8_t* out) const {
  uint8_t* at = out;
  wire::put(at, kFormat);
  wire::put(at, candidate_state);
  wire::put(at, static_cast<uint8_t>(has_confirmed));
  wire::put(at, uint8_t{0});
  memcpy(at, confirmed, sizeof confirmed);
  memcpy(at + sizeof confirmed, candidate, sizeof candidate);
  at += sizeof confirmed + sizeof candidate;
  wire::put(at, crc32(out, static_cast<size_t>(at - out)));
}

bool BoardBlock::decode(const uint8_t* data, size_t size, BoardBlock& out) {
  if (size != kSize || crc32(data, size) != kCrcResidue || data[0] != kFormat) return false;
  out.candidate_state = static_cast<Candidate>(data[1]);
  out.has_confirmed = data[2] != 0;
  memcpy(out.confirmed, data + kHeaderSize, sizeof out.confirmed);
  memcpy(out.candidate, data + kHeaderSize + sizeof out.confirmed, sizeof out.candidate);
  return true;
}

void BoardKeeper::start() {
  uint8_t bytes[BoardBlock::kSize];
  const size_t size = store_.load(bytes, sizeof bytes);
  if (size == 0 && store_.faults() == 0) {
    take_built_in();
    return;
  }
  // What is stored cannot be read: nothing is known of the wiring, so nothing is driven.
  if (!BoardBlock::decode(bytes, size, block_)) return;
  using Candidate = BoardBlock::Candidate;
  if (block_.candidate_state == Candidate::kRequested) {
    // The trial is recorded first: if the chip does not come back, the next start finds it tried.
    block_.candidate_state = Candidate::kTried;
    if (save() && take(block_.candidate, BoardState::kTrial)) return;
  }
  if (block_.candidate_state != Candidate::kNone) {
    block_.candidate_state = Candidate::kNone;
    save();  // If it fails, the next start comes to the same end.
  }
  if (block_.has_confirmed) {
    take(block_.confirmed, BoardState::kStored);
  } else {
    take_built_in();
  }
}

RefusalCode BoardKeeper::write(const uint8_t* packed) {
  if (on_trial()) return RefusalCode::kBoardOnTrial;
  BoardDescription board;
  if (read_board(packed, BoardDescription::kSize, board) != BoardFault::kNone || !fits(board))
    return RefusalCode::kBoardRefused;
  memcpy(block_.candidate, packed, sizeof block_.candidate);
  block_.candidate_state = BoardBlock::Candidate::kWritten;
  is_fresh_ = save();
  if (is_fresh_) return RefusalCode::kNone;
  block_.candidate_state = BoardBlock::Candidate::kNone;
  return RefusalCode::kStoreFailed;
}

RefusalCode BoardKeeper::request_trial() {
  if (!is_fresh_) return RefusalCode::kNone;
  block_.candidate_state = BoardBlock::Candidate::kRequested;
  if (save()) return RefusalCode::kNone;
  block_.candidate_state = BoardBlock::Candidate::kWritten;
  return RefusalCode::kStoreFailed;
}

RefusalCode BoardKeeper::confirm(uint32_t fingerprint) {
  if (!on_trial() && state_ != BoardState::kBuiltIn) return RefusalCode::kNoBoardOnTrial;
  if (fingerprint != fingerprint_) return RefusalCode::kBoardRefused;
  const BoardBlock before = block_;
  write_board(board_, block_.confirmed);
  block_.has_confirmed = true;
  block_.candidate_state = BoardBlock::Candidate::kNone;
  if (!save()) {
    block_ = before;
    return RefusalCode::kStoreFailed;
  }
  is_fresh_ = false;
  // The image's own board gets its pins at the next start, as any board does.
  if (on_trial()) state_ = BoardState::kStored;
  return RefusalCode::kNone;
}

bool BoardKeeper::take(const uint8_t* packed, BoardState state) {
  BoardDescription board;
  if (read_board(packed, BoardDescription::kSize, board) != BoardFault::kNone || !fits(board))
    return false;
  board_ = board;
  fingerprint_ = wheelwire::fingerprint(board);
  state_ = state;
  return true;
}

void BoardKeeper::take_built_in() {
  if (built_in_ == nullptr) return;
  board_ = *built_in_;
  fingerprint_ = wheelwire::fingerprint(board_);
  state_ = confirmation_ == BuiltIn::kConfirmed ? BoardState::kStored : BoardState::kBuiltIn;
}

bool BoardKeeper::fits(const BoardDescription& board) const {
  return board.chip == chip_ && first_issue(board).fault == BoardFault::kNone;
}

bool BoardKeeper::save() {
  uint8_t bytes[BoardBlock::kSize];
  block_.encode(bytes);
  return store_.save(bytes, sizeof bytes);
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
