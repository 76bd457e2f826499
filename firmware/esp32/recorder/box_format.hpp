// How a black box lies in memory: words, in segments, each begun by the state of the core.
// A segment is a head and records. A record is a word (kind, argument, check) and its payload. Each
// check covers all earlier records of the segment. So neither a record torn by a reset nor remains
// of an earlier use look like a valid record.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace wheelwire::box {

constexpr uint32_t kBoxMagic = 0x31425757;  // "WWB1"
constexpr size_t kSegments = 4;
constexpr size_t kWords = 8128;  ///< Words of all segments: 32 KB less the head of a slot in flash.
constexpr size_t kSegmentWords = kWords / kSegments;

/// Words of a segment's head: the magic number, the segment's number, the words of BoxOrigin, how
/// many words of the previous segment are used, and the check of all these.
constexpr size_t kHeadWords = 8;

/// The first kinds have a payload of fixed size. For the others, the argument is their number of
/// words, so a reader can skip kinds that it does not know.
enum class Kind : uint8_t {
  kStep = 1,        ///< Changes since the last step: time and ticks; duties.
  kContact = 2,     ///< Argument: open, and how many reads before saw the previous level.
  kTransition = 3,  ///< Argument: event, states before and after. Payload: faults.
  kRefusal = 4,     ///< Payload: message id, code.
  kStore = 5,       ///< Argument: done. Payload: faults.
  kHangUp = 6,      ///< Payload: time.
  kFailure = 7,     ///< Payload: faults.
  kState = 8,
  kWideStep = 9,  ///< A StepNote in full.
  kMessage = 10,
  kParameters = 11,
  kEnd = 12,       ///< The last one of a box that was closed: time and duties.
  kStall = 13,     ///< The processor was held up.
  kReflexes = 14,  ///< Payload: what the sensors forbid, from the step after it on.
};
constexpr uint32_t kLastKnown = 14;
constexpr uint32_t kFirstLong = 8;
constexpr size_t kShortWords[kFirstLong] = {0, 2, 0, 1, 1, 1, 2, 1};

// What a step's change must lie within, to be packed.
constexpr int32_t kTickBits = 9;
constexpr int32_t kTimeBits = 14;
constexpr int32_t kLatchBits = 5;
constexpr int32_t kBatteryBits = 7;
constexpr size_t kWideWords = 9;
constexpr size_t kEndWords = 3;

/// Flags of a kState's first word, and of a kMessage's.
constexpr uint32_t kInStep = 1;
constexpr uint32_t kOpenContact = 2;

/// One more word in a check.
constexpr uint32_t mix(uint32_t check, uint32_t word) {
  check = (check ^ word) * 0x9e3779b1u;
  return check ^ check >> 15;
}

/// Whether a segment begins with these words.
constexpr bool is_head(const uint32_t* words) {
  uint32_t check = 0;
  for (size_t i = 0; i + 1 < kHeadWords; ++i) check = mix(check, words[i]);
  return words[0] == kBoxMagic && words[kHeadWords - 1] == check;
}

constexpr uint32_t info(Kind kind, uint32_t argument) {
  return static_cast<uint32_t>(kind) | argument << 4;
}

}  // namespace wheelwire::box
