#include "peripheral_keeper.hpp"

namespace wheelwire {

void PeripheralKeeper::start(const BoardDescription* board) {
  using Found = TrialStore<PeripheralList::kSize>::Found;
  PeripheralList found;
  const auto is_usable = [&](const uint8_t* packed) {
    if (read_list(packed, PeripheralList::kSize, found) != PeripheralFault::kNone) return false;
    if (board == nullptr || found.board != wheelwire::fingerprint(*board)) return false;
    return first_issue(found, *board).fault == PeripheralFault::kNone;
  };
  const uint8_t* packed = nullptr;
  const Found outcome = store_.start(is_usable, packed);
  if (outcome == Found::kNothing) {
    const bool fits = built_in_ != nullptr && board != nullptr &&
                      built_in_->board == wheelwire::fingerprint(*board);
    if (fits) take(*built_in_, PeripheralsState::kStored);
  } else if (outcome == Found::kUnreadable || !is_usable(packed)) {
    state_ = PeripheralsState::kUnusable;
  } else {
    take(found, outcome == Found::kTrial ? PeripheralsState::kTrial : PeripheralsState::kStored);
  }
}

void PeripheralKeeper::take(const PeripheralList& list, PeripheralsState state) {
  state_ = state;
  list_ = list;
  uint8_t packed[PeripheralList::kSize];
  fingerprint_ = write_list(list_, packed);
}

RefusalCode PeripheralKeeper::refusal() const {
  switch (state_) {
    case PeripheralsState::kTrial:
      return RefusalCode::kBoardOnTrial;
    case PeripheralsState::kUnusable:
      return RefusalCode::kBoardUnconfirmed;
    case PeripheralsState::kEmpty:
    case PeripheralsState::kStored:
      break;
  }
  return RefusalCode::kNone;
}

RefusalCode PeripheralKeeper::set(size_t channel, const uint8_t* packed) {
  if (channel >= kMostPeripherals) return RefusalCode::kOutOfRange;
  memcpy(staged_ + channel * kEntryWords, packed, Peripheral::kSize);
  return RefusalCode::kNone;
}

PeripheralList PeripheralKeeper::staged(uint8_t count, uint32_t board) const {
  PeripheralList list{.count = count, .board = board};
  const auto* const packed = reinterpret_cast<const uint8_t*>(staged_);
  for (size_t i = 0; i < count; ++i)
    list.entries[i] = Peripheral::decode(packed + i * Peripheral::kSize);
  return list;
}

RefusalCode PeripheralKeeper::write(uint8_t count, uint32_t board, uint32_t fingerprint) {
  if (state_ == PeripheralsState::kTrial) return RefusalCode::kBoardOnTrial;
  if (count > kMostPeripherals) return RefusalCode::kBoardRefused;
  uint8_t packed[PeripheralList::kSize];
  // Otherwise an entry was lost on the way, or set by another program.
  if (write_list(staged(count, board), packed) != fingerprint) return RefusalCode::kBoardRefused;
  return store_.write(packed);
}

RefusalCode PeripheralKeeper::confirm(uint32_t fingerprint) {
  if (state_ != PeripheralsState::kTrial) return RefusalCode::kNoBoardOnTrial;
  if (fingerprint != fingerprint_) return RefusalCode::kBoardRefused;
  uint8_t packed[PeripheralList::kSize];
  write_list(list_, packed);
  const RefusalCode refusal = store_.confirm(packed);
  if (refusal == RefusalCode::kNone) state_ = PeripheralsState::kStored;
  return refusal;
}

uint32_t PeripheralKeeper::state_word(size_t index) const {
  if (index == 0) return static_cast<uint32_t>(state_) | (store_.has_candidate() ? 0x100u : 0);
  return index == 1 ? fingerprint_ : staged_[index - 2];
}

void PeripheralKeeper::set_state_word(size_t index, uint32_t word) {
  if (index == 0) {
    state_ = static_cast<PeripheralsState>(word & 0xff);
    store_.restore_candidate((word & 0x100) != 0);
  } else if (index == 1) {
    fingerprint_ = word;
  } else {
    staged_[index - 2] = word;
  }
}

void PeripheralKeeper::drop_candidate() {
  store_.drop_candidate();
  memset(staged_, 0, sizeof staged_);
}

}  // namespace wheelwire
