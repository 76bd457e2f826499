#include "self_test_line.hpp"

namespace wheelwire {

int SelfTestLine::body_size_of_question(uint8_t id) {
  if (id == GroupGet::kId) return GroupGet::kSize;
  return id < 0x80 ? self_test_body_size(id) : -1;
}

size_t SelfTestLine::read(uint8_t* out, size_t capacity) {
  size_t size = 0;
  while (size < capacity) {
    if (is_whole_) {
      out[size++] = held_[passed_++];
      if (passed_ == held_size_) is_whole_ = false, held_size_ = passed_ = 0;
      continue;
    }
    if (chunk_used_ == chunk_size_) {
      chunk_used_ = 0;
      chunk_size_ = line_.read(chunk_, sizeof chunk_);
      if (chunk_size_ == 0) break;
    }
    take(chunk_[chunk_used_++]);
  }
  return size;
}

void SelfTestLine::take(uint8_t byte) {
  held_[held_size_++] = byte;
  Frame frame{};
  if (decoder_.feed(byte, frame) && serve(frame)) {
    held_size_ = 0;
    return;
  }
  // What is longer than any frame goes on in pieces.
  is_whole_ = byte == 0 || held_size_ == sizeof held_;
}

/// Whether it was for the self-test. A repeat is given its answer again.
bool SelfTestLine::serve(const Frame& frame) {
  if (frame.id == GroupGet::kId &&
      static_cast<uint8_t>(GroupGet::decode(frame.body).group) != kSelfTestGroup)
    return false;
  const uint8_t* in = frame.body;
  uint32_t session_id;
  uint16_t request_id;
  wire::get(in, session_id);
  wire::get(in, request_id);
  const bool is_repeat = answer_.size > 0 && session_id == session_id_ && request_id == request_id_;
  if (!is_repeat) {
    session_id_ = session_id;
    request_id_ = request_id;
    answer_ = self_test_.serve(frame, session_id, request_id);
  }
  uint8_t encoded[kMaxFrame];
  line_.write(encoded, encode_frame(answer_.id, seq_++, answer_.body, answer_.size, encoded));
  return true;
}

}  // namespace wheelwire
