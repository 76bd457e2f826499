// A block in two equal copies: a lost one is rewritten from the other.
#pragma once

#include "hal.hpp"

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
  void record(TwinStore& parameters, TwinStore& latches);

  size_t load(uint8_t* out, size_t capacity) override;
  bool save(const uint8_t* data, size_t size) override;
  bool format() override { return copies_[0]->format() && copies_[1]->format(); }
  /// As of the last load().
  uint32_t faults() override { return faults_; }
  bool has_lost_copy() override { return has_lost_copy_; }
  bool is_incomplete() override { return is_incomplete_; }
  bool repair() override;

 private:
  enum class State : uint8_t { kEmpty, kWhole, kDamaged, kOutdated };
  struct Copy {
    State state = State::kEmpty;
    uint8_t records = 0;  ///< Flags of the other blocks that exist.
    size_t size = 0;      ///< Of the block.
    uint32_t number = 0;
  };

  /// Reads into buffer_.
  Copy read(int copy);
  /// The copy that counts, and what it holds; -1 if neither is whole.
  int find(Copy& content);
  /// Writes the block in buffer_, which afterwards holds what was read back.
  bool write(int copy, const Copy& content);
  bool write(int copy, const Copy& content, const uint8_t* data);
  bool note(uint8_t flag);
  uint8_t existing();
  bool records(uint8_t flag) {
    Copy content;
    return find(content) >= 0 && (content.records & flag) != 0;
  }
  /// Whether a copy holds anything, be it damaged.
  bool exists() { return read(0).state != State::kEmpty || read(1).state != State::kEmpty; }
  bool is_gone();

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
