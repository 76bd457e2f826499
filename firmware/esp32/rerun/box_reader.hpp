// Reads a black box: what was recorded, in its order, from the oldest segment on.
#pragma once

#include "black_box.hpp"

namespace wheelwire {

/// A record, with what it says in full.
struct BoxEntry {
  box::Kind kind{};
  uint32_t argument = 0;
  const uint32_t* payload = nullptr;
  size_t words = 0;
  uint64_t t_us = 0;  ///< Of the step, message or end of a connection that it belongs to.
  StepNote step{};    ///< The newest one.
  // While a message is read:
  bool in_step = false;
  uint8_t message_id = 0;
  uint8_t body_size = 0;
  const uint8_t* body = nullptr;

  bool is_step() const { return kind == box::Kind::kStep || kind == box::Kind::kWideStep; }
};

class BoxReader {
 public:
  /// `memory`: as BlackBox has it, box::kWords words. It must outlive the reader.
  explicit BoxReader(const uint32_t* memory);

  /// There is nothing to read.
  bool is_empty() const { return count_ == 0; }
  /// How many segments were recorded and cannot be read, with all that came before them: a reset
  /// in the middle of a write, or memory that it damaged.
  size_t missing() const { return missing_; }
  /// Of the newest segment. Without meaning in an empty box.
  const BoxOrigin& origin() const { return origin_; }

  /// False at the end. A record of a kind that is not known here is passed over.
  bool next(BoxEntry& entry);

 private:
  struct Segment {
    const uint32_t* words = nullptr;
    uint32_t number = 0;
    uint32_t used_before = 0;
    size_t used = 0;  ///< Up to the first word that is not a record.
  };

  static bool read_head(const uint32_t* words, Segment& segment, BoxOrigin& origin);
  /// Whether there is a record at `at`, and how long it is. Continues `check` if so.
  static bool read_record(const uint32_t* words, size_t at, uint32_t& check, size_t& size);
  void decode(const uint32_t* record, size_t size, BoxEntry& entry);

  Segment segments_[box::kSegments];  // In the order of their numbers.
  size_t count_ = 0;
  size_t missing_ = 0;
  BoxOrigin origin_{};
  size_t segment_ = 0;
  size_t at_ = box::kHeadWords;
  BoxEntry last_{};
};

}  // namespace wheelwire
