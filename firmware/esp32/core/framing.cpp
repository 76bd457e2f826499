#include "framing.hpp"

#include "crc32.hpp"
#include "wire.hpp"

namespace wheelwire {
namespace {

constexpr uint16_t kRepeatWindow = 64;

}  // namespace

bool FrameDecoder::feed(uint8_t byte, Frame& frame) {
  if (byte == 0) return finish_chunk(frame);
  if (overlong_) return false;
  if (size_ == kMaxEncoded) {
    ++counters_.bad_cobs;
    overlong_ = true;
    return false;
  }
  buffer_[size_++] = byte;
  return false;
}

bool FrameDecoder::finish_chunk(Frame& frame) {
  size_t size = size_;
  const bool ignore = overlong_ || size == 0;
  size_ = 0;
  overlong_ = false;
  if (ignore) return false;
  if (!decode_cobs(size) || size < kHeaderSize + kCrcSize) {
    ++counters_.bad_cobs;
    return false;
  }
  if (crc32(buffer_, size) != kCrcResidue) {
    ++counters_.bad_crc;
    return false;
  }
  frame.id = buffer_[0];
  frame.body = buffer_ + kHeaderSize;
  check_sequence(static_cast<uint16_t>(buffer_[1] | buffer_[2] << 8));
  const int expected = body_size_(frame.id);
  if (expected < 0) {
    ++counters_.unknown_id;
    return false;
  }
  if (size != static_cast<size_t>(expected) + kHeaderSize + kCrcSize) {
    ++counters_.wrong_length;
    return false;
  }
  ++counters_.frames;
  return true;
}

/// In place: the decoded byte is always behind the encoded one. `size` becomes the payload's.
bool FrameDecoder::decode_cobs(size_t& size) {
  size_t out = 0;
  size_t in = 0;
  while (in < size) {
    const size_t code = buffer_[in++];
    if (in + code - 1 > size) return false;
    for (size_t i = 1; i < code; ++i) buffer_[out++] = buffer_[in++];
    if (in < size) buffer_[out++] = 0;  // payloads are too short for the code 0xff to occur
  }
  size = out;
  return true;
}

void FrameDecoder::check_sequence(uint16_t seq) {
  const uint16_t ahead = static_cast<uint16_t>(seq - expected_seq_);
  if (sequence_known_ && ahead != 0) {
    if (ahead >= static_cast<uint16_t>(-kRepeatWindow)) {
      ++counters_.repeated;
      return;
    }
    if (ahead < 0x8000) counters_.seq_lost += ahead;
  }
  sequence_known_ = true;
  expected_seq_ = static_cast<uint16_t>(seq + 1);
}

size_t encode_frame(uint8_t id, uint16_t seq, const uint8_t* body, size_t body_size, uint8_t* out) {
  uint8_t payload[kMaxPayload];
  uint8_t* end = payload;
  wire::put(end, id);
  wire::put(end, seq);
  memcpy(end, body, body_size);
  end += body_size;
  wire::put(end, crc32(payload, kHeaderSize + body_size));

  uint8_t* const begin = out;
  *out++ = 0;
  uint8_t* code = out++;
  *code = 1;
  for (const uint8_t* in = payload; in != end; ++in) {
    if (*in == 0) {
      code = out++;
      *code = 1;
    } else {
      *out++ = *in;
      ++*code;
    }
  }
  *out++ = 0;
  return static_cast<size_t>(out - begin);
}

}  // namespace wheelwire
