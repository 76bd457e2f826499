// A block in two equal copies: a lost one is rewritten from the other.
#pragma once

#include <string.h>

#include "crc32.hpp"
#include "hal.hpp"
#include "protocol.hpp"
#include "wire.hpp"

namespace wheelwire {

/// Each copy holds the block, a number that grows with each save, and a checksum. A save is done
/// once both copies hold it and were read back. If the power fails in the middle, the copy with the
/// higher number counts: it holds the old block or the new one. If neither copy is whole, the block
/// is damaged.
///
/// Flash may lose a copy without a trace: NVS erases a blob whose checksum is wrong. So the
/// configuration's store records which other blocks exist: see `record`.
class TwinStore final : public BlockStore {
 public:
  /// The longest block.
  static constexpr size_t kCapacity = 480;
  /// What a copy has in addition to the block.
  static constexpr size_t kTail = 11;

  TwinStore(BlockStore& first, BlockStore& second) : copies_{&first, &second} {}
  /// From now on this store records whether these have a block. `parameters` get none before this
  /// store has something, so they prove that it had. An e-stop does not wait for a record.
  void record(TwinStore& parameters, TwinStore& latches) {
    others_[0] = &parameters;
    others_[1] = &latches;
    parameters.recorder_ = latches.recorder_ = this;
    parameters.flag_ = 1;
    latches.flag_ = 2;
    parameters.waits_ = true;
  }

  size_t load(uint8_t* out, size_t capacity) override {
    Copy content;
    const int copy = find(content);
    if (copy < 0) return 0;
    read(copy);
    memcpy(out, buffer_, content.size < capacity ? content.size : capacity);
    return content.size;
  }
  bool save(const uint8_t* data, size_t size) override {
    if (size == 0 || size > kCapacity) return false;
    if (waits_ && !recorder_->note(0)) return false;
    Copy content;
    const int last = find(content) == 0 ? 0 : 1;
    content.size = size;
    ++content.number;
    content.records |= existing();
    is_incomplete_ = true;
    // The one that counts last: until then a cut of the power leaves it.
    if (!write(1 - last, content, data) || !write(last, content, data)) return false;
    is_incomplete_ = false;
    faults_ = 0;
    const bool is_recorded = recorder_ == nullptr || recorder_->note(flag_);
    return is_recorded || !waits_;
  }
  bool format() override { return copies_[0]->format() && copies_[1]->format(); }
  /// As of the last load().
  uint32_t faults() override { return faults_; }
  bool has_lost_copy() override { return has_lost_copy_; }
  bool is_incomplete() override { return is_incomplete_; }
  bool repair() override {
    Copy content;
    const int copy = find(content);
    if (copy < 0 || !is_incomplete_) return true;
    read(copy);
    is_incomplete_ = !write(1 - copy, content) || (recorder_ != nullptr && !recorder_->note(flag_));
    return !is_incomplete_;
  }

 private:
  // After the block: this, the records, the number, the checksum. Earlier firmware left out the
  // first two.
  static constexpr uint16_t kSlotMagic = 0x3257;  // "W2"
  static constexpr int kAttempts = 2;

  enum class State : uint8_t { kEmpty, kWhole, kDamaged, kOutdated };
  struct Copy {
    State state = State::kEmpty;
    uint8_t records = 0;  ///< Flags of the other blocks that exist.
    size_t size = 0;      ///< Of the block.
    uint32_t number = 0;
  };

  /// Reads into buffer_.
  Copy read(int copy) {
    Copy found;
    const size_t size = copies_[copy]->load(buffer_, sizeof buffer_);
    if (size == 0) return found;
    found.state = State::kDamaged;
    if (size < kTail || size > sizeof buffer_ || crc32(buffer_, size) != kCrcResidue) return found;
    found.size = size - kTail;
    const uint8_t* at = buffer_ + found.size;
    const auto magic = wire::take<uint16_t>(at);
    wire::get(at, found.records);
    wire::get(at, found.number);
    found.state = magic == kSlotMagic ? State::kWhole : State::kOutdated;
    return found;
  }
  /// The copy that counts, and what it holds; -1 if neither is whole.
  int find(Copy& content) {
    const Copy copies[2] = {read(0), read(1)};
    const bool whole[2] = {copies[0].state == State::kWhole, copies[1].state == State::kWhole};
    // The difference, as the numbers may wrap.
    const auto ahead = static_cast<int32_t>(copies[1].number - copies[0].number);
    is_incomplete_ = has_lost_copy_ = false;
    if (whole[0] || whole[1]) {
      const int newest = whole[1] && (!whole[0] || ahead > 0) ? 1 : 0;
      content = copies[newest];
      faults_ = 0;
      has_lost_copy_ = !(whole[0] && whole[1]);
      is_incomplete_ =
          has_lost_copy_ || ahead != 0 || (recorder_ != nullptr && !recorder_->records(flag_));
      return newest;
    }
    faults_ = copies_[0]->faults() | copies_[1]->faults();
    const auto either = [&copies](State state) {
      return copies[0].state == state || copies[1].state == state;
    };
    if (either(State::kOutdated)) {
      faults_ |= fault::kStoreOutdated;
    } else if (either(State::kDamaged) || is_gone()) {
      faults_ |= fault::kStoreUnreadable;
    }
    return -1;
  }
  /// Writes the block in buffer_, which afterwards holds what was read back.
  bool write(int copy, const Copy& content) {
    uint8_t* at = buffer_ + content.size;
    wire::put(at, kSlotMagic);
    wire::put(at, content.records);
    wire::put(at, content.number);
    const uint32_t crc = crc32(buffer_, static_cast<size_t>(at - buffer_));
    wire::put(at, crc);
    if (!copies_[copy]->save(buffer_, content.size + kTail)) return false;
    // Flash that was written while the power failed may take a later write badly, and NVS may lose
    // an entry that it has just taken.
    const Copy written = read(copy);
    if (written.state != State::kWhole || written.size != content.size) return false;
    const uint8_t* end = buffer_ + content.size + kTail - sizeof crc;
    return wire::take<uint32_t>(end) == crc;
  }
  bool write(int copy, const Copy& content, const uint8_t* data) {
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      memcpy(buffer_, data, content.size);
      if (write(copy, content)) return true;
    }
    return false;
  }
  /// Records that another block exists; 0: only makes sure that there is a record at all.
  bool note(uint8_t flag) {
    Copy content;
    const int found = find(content);
    // A configuration that is damaged stays so until another one is written.
    if (found < 0 && faults_ != 0) return true;
    if (found >= 0 && (content.records | flag) == content.records) return true;
    const int last = found == 0 ? 0 : 1;
    content.records |= static_cast<uint8_t>(flag | existing());
    ++content.number;
    if (found >= 0) read(found);
    // What the first one holds afterwards is the block for the second one.
    is_incomplete_ = !write(1 - last, content) || !write(last, content);
    return !is_incomplete_;
  }
  /// Flags of the other blocks that exist.
  uint8_t existing() {
    uint8_t flags = 0;
    for (TwinStore* const other : others_)
      if (other != nullptr && other->exists()) flags |= other->flag_;
    return flags;
  }
  bool records(uint8_t flag) {
    Copy content;
    return find(content) >= 0 && (content.records & flag) != 0;
  }
  /// Whether a copy holds anything, be it damaged.
  bool exists() { return read(0).state != State::kEmpty || read(1).state != State::kEmpty; }
  /// Both copies are empty. Whether there was a block.
  bool is_gone() {
    if (recorder_ != nullptr) return recorder_->records(flag_);
    return others_[0] != nullptr && others_[0]->exists();
  }

  BlockStore* copies_[2];
  TwinStore* others_[2]{};         ///< What this one records.
  TwinStore* recorder_ = nullptr;  ///< What records this one,
  uint8_t flag_ = 0;               ///< and as what,
  bool waits_ = false;             ///< before it is saved.
  bool has_lost_copy_ = false;
  bool is_incomplete_ = false;
  uint32_t faults_ = 0;
  uint8_t buffer_[kCapacity + kTail];
};

}  // namespace wheelwire
