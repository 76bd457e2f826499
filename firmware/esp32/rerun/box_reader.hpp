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
  explicit BoxReader(const uint32_t* memory) {
    Segment found[box::kSegments];
    BoxOrigin origins[box::kSegments];
    int newest = -1;
    for (size_t i = 0; i < box::kSegments; ++i) {
      if (!read_head(memory + i * box::kSegmentWords, found[i], origins[i])) {
        found[i].words = nullptr;
      } else if (newest < 0 || found[i].number > found[newest].number) {
        newest = static_cast<int>(i);
      }
    }
    if (newest < 0) return;
    origin_ = origins[newest];
    // Backwards, as long as each one is whole: it ends where its successor says.
    size_t first = static_cast<size_t>(newest);
    count_ = 1;
    while (count_ < box::kSegments) {
      const size_t before = (first + box::kSegments - 1) % box::kSegments;
      if (found[before].words == nullptr || found[before].number + 1 != found[first].number ||
          found[before].used != found[first].used_before)
        break;
      first = before;
      ++count_;
    }
    const uint32_t recorded = found[newest].number;
    missing_ = (recorded < box::kSegments ? recorded : box::kSegments) - count_;
    for (size_t i = 0; i < count_; ++i) segments_[i] = found[(first + i) % box::kSegments];
  }

  /// There is nothing to read.
  bool is_empty() const { return count_ == 0; }
  /// How many segments were recorded and cannot be read, with all that came before them: a reset
  /// in the middle of a write, or memory that it damaged.
  size_t missing() const { return missing_; }
  /// Of the newest segment. Without meaning in an empty box.
  const BoxOrigin& origin() const { return origin_; }

  /// False at the end. A record of a kind that is not known here is passed over.
  bool next(BoxEntry& entry) {
    while (segment_ < count_) {
      const Segment& segment = segments_[segment_];
      if (at_ >= segment.used) {
        ++segment_;
        at_ = box::kHeadWords;
        continue;
      }
      const uint32_t* const record = segment.words + at_;
      const uint32_t kind = record[0] & 15;
      const size_t size =
          1 + (kind < box::kFirstLong ? box::kShortWords[kind] : record[0] >> 4 & 0xfff);
      at_ += size;
      if (kind > box::kLastKnown) continue;
      decode(record, size, last_);
      entry = last_;
      return true;
    }
    return false;
  }

 private:
  using Kind = box::Kind;

  static constexpr uint64_t join(const uint32_t* words) {
    return words[0] | static_cast<uint64_t>(words[1]) << 32;
  }

  /// The lowest bits, as two's complement.
  static constexpr int32_t signed_bits(uint32_t word, int bits) {
    return static_cast<int32_t>(word << (32 - bits)) >> (32 - bits);
  }

  static constexpr uint32_t bits(uint32_t word, int count) { return word & ((1u << count) - 1); }

  static int16_t sum(int16_t value, int32_t change) { return static_cast<int16_t>(value + change); }

  static void read_duties(uint32_t word, StepNote& step) {
    step.left_duty_q15 = static_cast<int16_t>(word);
    step.right_duty_q15 = static_cast<int16_t>(word >> 16);
  }

  struct Segment {
    const uint32_t* words = nullptr;
    uint32_t number = 0;
    uint32_t used_before = 0;
    size_t used = 0;  ///< Up to the first word that is not a record.
  };

  static bool read_head(const uint32_t* words, Segment& segment, BoxOrigin& origin) {
    if (!box::is_head(words)) return false;
    uint32_t check = words[box::kHeadWords - 1];
    segment.words = words;
    segment.number = words[1];
    origin = {.core = words[2], .release = words[3], .git_hash = words[4], .boot_id = words[5]};
    segment.used_before = words[6];
    // The first record is the state: what follows means nothing without it.
    segment.used = box::kHeadWords;
    size_t size;
    while (read_record(words, segment.used, check, size)) segment.used += size;
    return segment.used > box::kHeadWords &&
           static_cast<Kind>(words[box::kHeadWords] & 15) == Kind::kState;
  }
  /// Whether there is a record at `at`, and how long it is. Continues `check` if so.
  static bool read_record(const uint32_t* words, size_t at, uint32_t& check, size_t& size) {
    if (at >= box::kSegmentWords) return false;
    const uint32_t kind = words[at] & 15;
    const uint32_t argument = words[at] >> 4 & 0xfff;
    const size_t payload = kind < box::kFirstLong ? box::kShortWords[kind] : argument;
    if (kind == 0 || at + payload >= box::kSegmentWords) return false;
    uint32_t found = box::mix(check, words[at] & 0xffff);
    for (size_t i = 1; i <= payload; ++i) found = box::mix(found, words[at + i]);
    if ((found & 0xffff0000u) != (words[at] & 0xffff0000u)) return false;
    check = found;
    size = payload + 1;
    return true;
  }
  void decode(const uint32_t* record, size_t size, BoxEntry& entry) {
    const uint32_t* const payload = record + 1;
    StepNote& step = entry.step;
    entry.kind = static_cast<Kind>(record[0] & 15);
    entry.argument = record[0] >> 4 & 0xfff;
    entry.payload = payload;
    entry.words = size - 1;
    switch (entry.kind) {
      case Kind::kStep:
        step.now_us += bits(payload[0], box::kTimeBits);
        step.t_us = step.now_us + bits(entry.argument, box::kLatchBits);
        step.battery_mv = static_cast<uint16_t>(
            step.battery_mv + signed_bits(entry.argument >> box::kLatchBits, box::kBatteryBits));
        step.left_counter =
            sum(step.left_counter, signed_bits(payload[0] >> box::kTimeBits, box::kTickBits));
        step.right_counter =
            sum(step.right_counter,
                signed_bits(payload[0] >> (box::kTimeBits + box::kTickBits), box::kTickBits));
        read_duties(payload[1], step);
        entry.t_us = step.now_us;
        break;
      case Kind::kWideStep:
        if (entry.words < box::kWideWords) break;
        step.now_us = join(payload);
        step.t_us = join(payload + 2);
        step.left_counter = static_cast<int16_t>(payload[4]);
        step.right_counter = static_cast<int16_t>(payload[4] >> 16);
        step.left_illegal = payload[5];
        step.right_illegal = payload[6];
        step.battery_mv = static_cast<uint16_t>(payload[7]);
        read_duties(payload[8], step);
        entry.t_us = step.now_us;
        break;
      case Kind::kEnd:
        if (entry.words < box::kEndWords) break;
        entry.t_us = join(payload);
        read_duties(payload[2], step);
        break;
      case Kind::kHangUp:
        entry.t_us = join(payload);
        break;
      case Kind::kMessage: {
        if (entry.words < 1) break;
        entry.in_step = (payload[0] >> 16 & box::kInStep) != 0;
        const size_t head = entry.in_step ? 1 : 3;
        entry.message_id = static_cast<uint8_t>(payload[0]);
        entry.body_size = static_cast<uint8_t>(payload[0] >> 8);
        entry.body = reinterpret_cast<const uint8_t*>(payload + head);
        if (head + (entry.body_size + 3u) / 4 > entry.words) {
          entry.body_size = 0;  // Not as it is written: no message is that short.
        } else if (!entry.in_step) {
          entry.t_us = join(payload + 1);
        }
        break;
      }
      case Kind::kContact:
      case Kind::kTransition:
      case Kind::kRefusal:
      case Kind::kStore:
      case Kind::kFailure:
      case Kind::kState:
      case Kind::kParameters:
      case Kind::kStall:
      case Kind::kReflexes:
        break;
    }
  }

  Segment segments_[box::kSegments];  // In the order of their numbers.
  size_t count_ = 0;
  size_t missing_ = 0;
  BoxOrigin origin_{};
  size_t segment_ = 0;
  size_t at_ = box::kHeadWords;
  BoxEntry last_{};
};

}  // namespace wheelwire
