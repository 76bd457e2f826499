// Frames on the wire: 0x00, COBS(id, seq, body, CRC-32), 0x00. See protocol/SPEC.md, "Framing".
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "protocol.hpp"

namespace wheelwire {

constexpr size_t kHeaderSize = 3;
constexpr size_t kCrcSize = 4;
constexpr size_t kMaxBody = kMaxPayload - kHeaderSize - kCrcSize;
constexpr size_t kCobsSize = 1;
constexpr size_t kMaxEncoded = kCobsSize + kMaxPayload;
constexpr size_t kMaxFrame = kMaxEncoded + 2;
static_assert(kMaxPayload < 254, "COBS would need a second code byte");

/// Bytes on the wire of a frame whose body has this size.
constexpr size_t frame_size(size_t body_size) {
  return body_size + kHeaderSize + kCrcSize + kCobsSize + 2;
}

/// A frame that passed all checks. Valid until the next byte is fed.
struct Frame {
  uint8_t id;
  const uint8_t* body;
};

struct ReceiveCounters {
  uint32_t frames;
  uint32_t bad_crc;
  uint32_t bad_cobs;
  uint32_t unknown_id;
  uint32_t wrong_length;
  uint32_t seq_lost;  ///< A frame that arrives late is subtracted again.
  uint32_t repeated;
};

/// Bytes in, good frames out. Never buffers more than one encoded payload.
class FrameDecoder {
 public:
  using BodySize = int (*)(uint8_t id);

  /// `body_size` returns the body size of each id that is known here, -1 for any other.
  explicit FrameDecoder(BodySize body_size) : body_size_(body_size) {}

  /// Consumes bytes up to the one that completes a good frame, or all of them; returns how many.
  /// Sets `complete` if such a frame is now in `frame`.
  size_t feed(const uint8_t* data, size_t size, Frame& frame, bool& complete);
  /// Returns true when `byte` completed a good frame, which is then in `frame`.
  bool feed(uint8_t byte, Frame& frame) {
    bool complete;
    feed(&byte, 1, frame, complete);
    return complete;
  }
  /// Expect any sequence number next.
  void restart_sequence() { sequence_known_ = false; }
  /// The line was reopened: drops a partial frame. The counters continue.
  void restart() {
    size_ = 0;
    overlong_ = false;
    sequence_known_ = false;
  }

  const ReceiveCounters& counters() const { return counters_; }

 private:
  void append(const uint8_t* data, size_t size);
  bool finish_chunk(Frame& frame);
  bool decode_cobs(size_t encoded_size);
  void check_sequence(uint16_t seq);
  void move_window(uint32_t missed) {
    missed_[1] = missed_[1] << 1 | missed_[0] >> 31;
    missed_[0] = missed_[0] << 1 | missed;
  }
  void note_behind(uint16_t index);

  BodySize body_size_;
  ReceiveCounters counters_{};
  uint8_t buffer_[kMaxEncoded];
  size_t size_ = 0;
  bool overlong_ = false;
  bool sequence_known_ = false;
  uint16_t expected_seq_ = 0;
  uint32_t missed_[2] = {};  ///< Bit n: the frame n + 1 before the expected one has not arrived.
};

/// Writes the frame of a body to `out`, which holds kMaxFrame bytes. Returns its size.
size_t encode_frame(uint8_t id, uint16_t seq, const uint8_t* body, size_t body_size, uint8_t* out);

}  // namespace wheelwire
