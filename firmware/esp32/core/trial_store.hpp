// Something that is tried before it is confirmed: a board, a list of peripherals. What was written
// is tried once the host restarts the device, and saved only if the host then confirms it;
// otherwise the previous one returns.
#pragma once

#include <string.h>

#include "crc32.hpp"
#include "hal.hpp"
#include "protocol.hpp"

namespace wheelwire {

/// Within this after the start what is on trial is confirmed, or the device restarts with the
/// previous one.
constexpr uint64_t kStoreTrialUs = 10'000'000;

/// What the store holds: both items and how far the trial is, replaced as a whole. So a cut of the
/// power leaves what was before a write, or what is after it.
template <size_t kItemSize>
struct TrialBlock {
  /// kWritten: no restart was asked for yet. kRequested: the next start tries it. kConfirmed: what
  /// is confirmed may lie in one slot of the store alone.
  enum class Candidate : uint8_t { kNone, kWritten, kTried, kRequested, kConfirmed };

  static constexpr uint8_t kFormat = 1;
  static constexpr size_t kHeaderSize = 4;
  static constexpr size_t kSize = kHeaderSize + 2 * kItemSize + 4;

  Candidate candidate_state = Candidate::kNone;
  bool has_confirmed = false;
  uint8_t confirmed[kItemSize]{};
  uint8_t candidate[kItemSize]{};

  void encode(uint8_t* out) const {
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
  /// False if it is damaged, or of another format.
  static bool decode(const uint8_t* data, size_t size, TrialBlock& out) {
    if (size != kSize || crc32(data, size) != kCrcResidue || data[0] != kFormat) return false;
    out.candidate_state = static_cast<Candidate>(data[1]);
    out.has_confirmed = data[2] != 0;
    memcpy(out.confirmed, data + kHeaderSize, sizeof out.confirmed);
    memcpy(out.candidate, data + kHeaderSize + sizeof out.confirmed, sizeof out.candidate);
    return true;
  }
};

template <size_t kItemSize>
class TrialStore {
 public:
  using Block = TrialBlock<kItemSize>;
  /// What the start found.
  enum class Found : uint8_t { kNothing, kUnreadable, kConfirmed, kTrial };

  explicit TrialStore(ParameterStore& store) : store_(store) {}

  /// Decides which item is active until the next start. `is_usable(packed)` may refuse one on
  /// trial. Of kConfirmed and kTrial `packed` is the item.
  template <typename IsUsable>
  Found start(IsUsable&& is_usable, const uint8_t*& packed) {
    using Candidate = typename Block::Candidate;
    uint8_t bytes[Block::kSize];
    const size_t size = store_.load(bytes, sizeof bytes);
    if (size == 0 && store_.faults() == 0) return Found::kNothing;
    if (!Block::decode(bytes, size, block_)) {
      // Nobody knows what was confirmed. A block that says so is saved with the next item that is
      // written: one without a confirmed item would say that there never was any.
      block_.has_confirmed = true;
      return Found::kUnreadable;
    }
    if (block_.candidate_state == Candidate::kRequested) {
      // The trial is recorded first: if the chip does not come back, the next start finds it tried.
      block_.candidate_state = Candidate::kTried;
      if (save() && is_usable(block_.candidate)) {
        packed = block_.candidate;
        return Found::kTrial;
      }
    }
    if (block_.candidate_state != Candidate::kNone) {
      const bool is_single = block_.candidate_state == Candidate::kConfirmed;
      block_.candidate_state = Candidate::kNone;
      // If it fails, the next start comes to the same end.
      if (!save() && is_single) return Found::kUnreadable;
    }
    packed = block_.confirmed;
    return block_.has_confirmed ? Found::kConfirmed : Found::kNothing;
  }

  // Each returns kNone, or why it was refused.
  /// Stores an item, to be tried if a restart is asked for in this session.
  RefusalCode write(const uint8_t* packed) {
    using Candidate = typename Block::Candidate;
    memcpy(block_.candidate, packed, kItemSize);
    block_.candidate_state = Candidate::kWritten;
    is_fresh_ = save();
    if (is_fresh_) return RefusalCode::kNone;
    block_.candidate_state = Candidate::kNone;
    return RefusalCode::kStoreFailed;
  }
  /// A restart was asked for: what was written in this session is tried.
  RefusalCode request_trial() {
    using Candidate = typename Block::Candidate;
    if (!is_fresh_) return RefusalCode::kNone;
    block_.candidate_state = Candidate::kRequested;
    if (save()) return RefusalCode::kNone;
    block_.candidate_state = Candidate::kWritten;
    return RefusalCode::kStoreFailed;
  }
  /// Saves the active item, twice: once the newest block is damaged, the one before it counts, and
  /// must not say that another item is confirmed, or none.
  RefusalCode confirm(const uint8_t* packed) {
    const Block before = block_;
    memcpy(block_.confirmed, packed, kItemSize);
    block_.has_confirmed = true;
    block_.candidate_state = Block::Candidate::kConfirmed;
    const bool is_saved = save();
    block_.candidate_state = Block::Candidate::kNone;
    if (!is_saved || !save()) {
      block_ = before;
      return RefusalCode::kStoreFailed;
    }
    is_fresh_ = false;
    return RefusalCode::kNone;
  }

  /// Whether a restart would try another item.
  bool has_candidate() const { return is_fresh_; }
  /// A new session: what the previous one wrote and did not restart for is not tried.
  void drop_candidate() { is_fresh_ = false; }

  /// For a re-run.
  void restore_candidate(bool is_fresh) { is_fresh_ = is_fresh; }

 private:
  bool save() {
    uint8_t bytes[Block::kSize];
    block_.encode(bytes);
    return store_.save(bytes, sizeof bytes);
  }

  ParameterStore& store_;
  bool is_fresh_ = false;  // The candidate was written in this session.
  Block block_;
};

}  // namespace wheelwire
