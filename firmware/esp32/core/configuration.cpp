#include "configuration.hpp"

#include "crc32.hpp"
#include "twin_store.hpp"

namespace wheelwire {

// --- packed --------------------------------------------------------------------------------------

uint32_t Configuration::encode(uint8_t* out) const {
  board.encode(out);
  uint8_t* at = out + BoardDescription::kSize;
  wire::put(at, peripherals.count);
  for (size_t i = 0; i < kMostPeripherals; ++i) {
    (i < peripherals.count ? peripherals.entries[i] : Peripheral{}).encode(at);
    at += Peripheral::kSize;
  }
  const uint32_t crc = crc32(out, static_cast<size_t>(at - out));
  wire::put(at, crc);
  return crc;
}

uint32_t Configuration::fingerprint() const {
  uint8_t packed[kSize];
  return encode(packed);
}

bool Configuration::decode(const uint8_t* data, size_t size, Configuration& out) {
  if (size != kSize || crc32(data, size) != kCrcResidue) return false;
  const uint8_t* at = data + BoardDescription::kSize;
  if (*at > kMostPeripherals) return false;
  out.board = BoardDescription::decode(data);
  wire::get(at, out.peripherals.count);
  for (Peripheral& entry : out.peripherals.entries) {
    entry = Peripheral::decode(at);
    at += Peripheral::kSize;
  }
  return true;
}

bool Configuration::is_usable() const {
  return first_issue(board).fault == BoardFault::kNone &&
         first_issue(peripherals, board).fault == PeripheralFault::kNone;
}

uint32_t checksum(const BoardDescription& board) {
  uint8_t packed[BoardDescription::kSize];
  board.encode(packed);
  return crc32(packed, sizeof packed);
}

void apply_board(const BoardDescription& board, ParameterSpec* specs) {
  const auto set = [specs](ParameterId id, float value) {
    specs[static_cast<size_t>(id) - 1].default_value = value;
  };
  set(ParameterId::kPwmFrequencyHz, board.pwm_frequency_hz);
  set(ParameterId::kGlitchFilterNs, board.encoder_filter_ns);
  if (board.estop < 0) set(ParameterId::kEstopInputEnabled, 0);
}

// --- the active one ------------------------------------------------------------------------------

void ActiveConfiguration::start() {
  if (!load()) return;
  if (block_.candidate_state == Candidate::kRequested) {
    // The trial is recorded first: if the chip does not come back, the next start finds it tried.
    block_.candidate_state = Candidate::kTried;
    if (save() && take(block_.candidate, ConfigurationState::kTrial)) return;
  }
  if (block_.candidate_state != Candidate::kNone) {
    block_.candidate_state = Candidate::kNone;
    save();  // If it fails, the next start comes to the same end.
  }
  if (!block_.has_confirmed) return take_built_in();
  if (!take(block_.confirmed, ConfigurationState::kStored)) faults_ |= fault::kStoreUnreadable;
}

/// False if nothing is known of the wiring.
bool ActiveConfiguration::load() {
  if (store_ == nullptr) return true;
  uint8_t bytes[Block::kSize];
  const size_t size = store_->load(bytes, sizeof bytes);
  faults_ = store_->faults();
  if (size == 0 && faults_ == 0) return true;
  if (size != sizeof bytes) {
    if (faults_ == 0) faults_ = fault::kStoreUnreadable;
    // What was confirmed is unknown. The block saved with the next configuration must say so:
    // without a confirmed configuration it would mean that none was ever confirmed.
    block_.has_confirmed = true;
    return false;
  }
  const uint8_t* at = bytes;
  wire::get(at, block_.candidate_state);
  block_.has_confirmed = *at++ != 0;
  memcpy(block_.confirmed, at, sizeof block_.confirmed);
  memcpy(block_.candidate, at + sizeof block_.confirmed, sizeof block_.candidate);
  return true;
}

bool ActiveConfiguration::save() {
  static_assert(Block::kSize <= TwinStore::kCapacity);
  uint8_t bytes[Block::kSize];
  uint8_t* at = bytes;
  wire::put(at, block_.candidate_state);
  wire::put(at, static_cast<uint8_t>(block_.has_confirmed));
  memcpy(at, block_.confirmed, sizeof block_.confirmed);
  memcpy(at + sizeof block_.confirmed, block_.candidate, sizeof block_.candidate);
  return store_->save(bytes, sizeof bytes);
}

bool ActiveConfiguration::take(const uint8_t* packed, ConfigurationState state) {
  Configuration found;
  if (!Configuration::decode(packed, Configuration::kSize, found)) return false;
  if (found.board.chip != chip_ || !found.is_usable()) return false;
  active_ = found;
  fingerprint_ = found.fingerprint();
  state_ = state;
  return true;
}

void ActiveConfiguration::take_built_in() {
  if (built_in_ == nullptr) return;
  active_ = *built_in_;
  fingerprint_ = active_.fingerprint();
  state_ = confirmation_ == BuiltIn::kConfirmed ? ConfigurationState::kStored
                                                : ConfigurationState::kBuiltIn;
}

RefusalCode ActiveConfiguration::refusal() const {
  switch (state_) {
    case ConfigurationState::kTrial:
      return RefusalCode::kBoardOnTrial;
    case ConfigurationState::kBuiltIn:
      return RefusalCode::kBoardUnconfirmed;
    case ConfigurationState::kDamaged:  // A fault, which names it.
    case ConfigurationState::kStored:
      break;
  }
  return RefusalCode::kNone;
}

RefusalCode ActiveConfiguration::stage_peripheral(size_t channel, const uint8_t* packed) {
  if (channel >= kMostPeripherals) return RefusalCode::kOutOfRange;
  auto* const entries = reinterpret_cast<uint8_t*>(staged_) + BoardDescription::kSize + 1;
  memcpy(entries + channel * Peripheral::kSize, packed, Peripheral::kSize);
  return RefusalCode::kNone;
}

RefusalCode ActiveConfiguration::write(uint8_t peripheral_count, uint32_t fingerprint) {
  if (on_trial()) return RefusalCode::kBoardOnTrial;
  if (peripheral_count > kMostPeripherals) return RefusalCode::kBoardRefused;
  const auto* at = reinterpret_cast<const uint8_t*>(staged_);
  Configuration staged{.board = BoardDescription::decode(at), .peripherals = {}};
  at += BoardDescription::kSize + 1;
  staged.peripherals.count = peripheral_count;
  for (size_t i = 0; i < peripheral_count; ++i)
    staged.peripherals.entries[i] = Peripheral::decode(at + i * Peripheral::kSize);
  uint8_t packed[Configuration::kSize];
  // Another fingerprint: a part was lost on the way, or set by another program.
  const bool is_meant = staged.encode(packed) == fingerprint;
  if (!is_meant || staged.board.chip != chip_ || !staged.is_usable())
    return RefusalCode::kBoardRefused;
  memcpy(block_.candidate, packed, sizeof packed);
  block_.candidate_state = Candidate::kWritten;
  is_fresh_ = save();
  if (is_fresh_) return RefusalCode::kNone;
  block_.candidate_state = Candidate::kNone;
  return RefusalCode::kStoreFailed;
}

RefusalCode ActiveConfiguration::confirm(uint32_t fingerprint) {
  if (!on_trial() && state_ != ConfigurationState::kBuiltIn) return RefusalCode::kNoBoardOnTrial;
  if (fingerprint != fingerprint_) return RefusalCode::kBoardRefused;
  const Block before = block_;
  active_.encode(block_.confirmed);
  block_.has_confirmed = true;
  block_.candidate_state = Candidate::kNone;
  if (!save()) {
    block_ = before;
    return RefusalCode::kStoreFailed;
  }
  is_fresh_ = false;
  // The image's own board gets its pins at the next start, as any board does.
  if (on_trial()) state_ = ConfigurationState::kStored;
  return RefusalCode::kNone;
}

RefusalCode ActiveConfiguration::request_trial() {
  if (!is_fresh_) return RefusalCode::kNone;
  block_.candidate_state = Candidate::kRequested;
  if (save()) return RefusalCode::kNone;
  block_.candidate_state = Candidate::kWritten;
  return RefusalCode::kStoreFailed;
}

}  // namespace wheelwire
