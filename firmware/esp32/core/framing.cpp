#include "framing.hpp"

#include "crc32.hpp"
#include "wire.hpp"

namespace wheelwire {
namespace {

constexpr uint16_t kRepeatWindow = 64;

}  // namespace

size_t FrameDecoder::feed(const uint8_t* data, size_t size, Frame& frame, bool& complete) {
  complete = false;
  size_t taken = 0;
  while (taken < size && !complete) {
    const uint8_t* const rest = data + taken;
    if (*rest == 0 && size_ == 0 && !overlong_) {  // between the delimiters of two frames
      ++taken;
      continue;
    }
    const auto* const delimiter = static_cast<const uint8_t*>(memchr(rest, 0, size - taken));
    const size_t chunk =
        delimiter == nullptr ? size - taken : static_cast<size_t>(delimiter - rest);
    append(rest, chunk);
    taken += chunk;
    if (delimiter == nullptr) break;
    complete = finish_chunk(frame);
    ++taken;
  }
  return taken;
}

void FrameDecoder::append(const uint8_t* data, size_t size) {
  const size_t room = kMaxEncoded - size_;
  if (size > room) {
    if (!overlong_) ++counters_.bad_cobs;
    overlong_ = true;
    size = room;
  }
  memcpy(buffer_ + size_, data, size);
  size_ += size;
}

bool FrameDecoder::finish_chunk(Frame& frame) {
  const size_t encoded_size = size_;
  const bool ignore = overlong_ || encoded_size == 0;
  size_ = 0;
  overlong_ = false;
  if (ignore) return false;
  if (!decode_cobs(encoded_size) || encoded_size < kCobsSize + kHeaderSize + kCrcSize) {
    ++counters_.bad_cobs;
    return false;
  }
  const uint8_t* const payload = buffer_ + kCobsSize;
  const size_t size = encoded_size - kCobsSize;
  if (crc32(payload, size) != kCrcResidue) {
    ++counters_.bad_crc;
    return false;
  }
  frame.id = payload[0];
  frame.body = payload + kHeaderSize;
  check_sequence(static_cast<uint16_t>(payload[1] | payload[2] << 8));
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

/// In place: the payload then begins after the first code byte. Payloads are too short for the code
/// 0xff, so every code byte except the first is where the payload has a zero.
bool FrameDecoder::decode_cobs(size_t encoded_size) {
  uint8_t* code = buffer_;
  uint8_t* const end = buffer_ + encoded_size;
  while (code < end) {
    const uint8_t distance = *code;
    *code = 0;
    code += distance;
  }
  return code == end;
}

void FrameDecoder::check_sequence(uint16_t seq) {
  const uint16_t ahead = static_cast<uint16_t>(seq - expected_seq_);
  if (sequence_known_ && ahead >= static_cast<uint16_t>(-kRepeatWindow)) {
    note_behind(static_cast<uint16_t>(-ahead - 1));
    return;
  }
  if (sequence_known_ && ahead < 0x8000) {
    counters_.seq_lost += ahead;
    for (uint16_t n = ahead < kRepeatWindow ? ahead : kRepeatWindow; n > 0; --n) move_window(1);
  } else {
    missed_[0] = missed_[1] = 0;
  }
  move_window(0);
  sequence_known_ = true;
  expected_seq_ = static_cast<uint16_t>(seq + 1);
}

void FrameDecoder::note_behind(uint16_t index) {
  uint32_t& word = missed_[index / 32];
  const uint32_t bit = 1U << index % 32;
  if ((word & bit) != 0) {
    word &= ~bit;
    --counters_.seq_lost;
  } else {
    ++counters_.repeated;
  }
}

size_t encode_frame(uint8_t id, uint16_t seq, const uint8_t* body, size_t body_size, uint8_t* out) {
  out[0] = 0;
  uint8_t* code = out + 1;
  uint8_t* const payload = code + kCobsSize;
  uint8_t* end = payload;
  wire::put(end, id);
  wire::put(end, seq);
  memcpy(end, body, body_size);
  end += body_size;
  wire::put(end, crc32(payload, kHeaderSize + body_size));
  *end = 0;
  // COBS: each zero of the payload is replaced by the distance to the next one, the last by the
  // distance to the delimiter.
  for (uint8_t* place = payload; place <= end; ++place) {
    if (*place != 0) continue;
    *code = static_cast<uint8_t>(place - code);
    code = place;
  }
  return static_cast<size_t>(end + 1 - out);
}

}  // namespace wheelwire
