// Rows of good frames with random contents, and what a decoder makes of a row that was damaged.
#pragma once

#include <algorithm>
#include <vector>

#include "framing.hpp"
#include "random.hpp"

namespace wheelwire::fuzz {

using Bytes = std::vector<uint8_t>;

/// One frame of a row: where its bytes are, delimiters included, and what it says.
struct Placed {
  size_t begin;
  size_t end;
  uint8_t id;
  uint8_t body[kMaxBody];

  bool says(const Frame& frame) const {
    return id == frame.id && memcmp(body, frame.body, static_cast<size_t>(body_size(id))) == 0;
  }
};

/// Frames with consecutive sequence numbers, one behind the other.
struct Row {
  Bytes bytes;
  std::vector<Placed> frames;

  void append(uint8_t id, uint16_t seq, sim::Random& random) {
    Placed placed{.begin = bytes.size(), .end = 0, .id = id, .body = {}};
    const auto size = static_cast<size_t>(body_size(id));
    // Zeros are as frequent as in real messages: COBS has work to do.
    for (size_t i = 0; i < size; ++i) {
      const uint64_t bits = random.next();
      placed.body[i] = bits % 4 == 0 ? 0 : static_cast<uint8_t>(bits >> 8);
    }
    uint8_t frame[kMaxFrame];
    bytes.insert(bytes.end(), frame, frame + encode_frame(id, seq, placed.body, size, frame));
    placed.end = bytes.size();
    frames.push_back(placed);
  }
};

/// The id of every message, of both directions.
inline Bytes all_ids() {
  Bytes ids;
  for (int id = 0; id < 256; ++id) {
    if (body_size(static_cast<uint8_t>(id)) >= 0) ids.push_back(static_cast<uint8_t>(id));
  }
  return ids;
}

/// What was found wrong; all of it should be 0 but the first two.
struct Findings {
  uint64_t injected = 0;
  uint64_t reached_crc = 0;  ///< Damaged chunks that only the CRC refused.
  uint64_t passed_crc = 0;   ///< Damaged chunks that only their id or length refused.
  uint64_t wrong = 0;        ///< Messages delivered but never sent.
  uint64_t lost = 0;         ///< Untouched frames that were not delivered.

  bool aims_met() const { return wrong == 0 && lost == 0; }

  void count_chunks(const ReceiveCounters& counters) {
    reached_crc += counters.bad_crc;
    passed_crc += counters.unknown_id + counters.wrong_length;
  }
};

}  // namespace wheelwire::fuzz
