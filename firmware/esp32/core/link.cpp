#include "link.hpp"

namespace wheelwire {
namespace {

/// Messages that only devices send are unknown to a device.
int received_body_size(uint8_t id) { return id < kFirstDeviceId ? body_size(id) : -1; }

}  // namespace

Link::Link(ByteStream& line) : line_(line), decoder_(received_body_size) {}

bool Link::receive(Frame& frame) {
  while (chunk_used_ < chunk_size_ || refill()) {
    bool complete;
    chunk_used_ += decoder_.feed(chunk_ + chunk_used_, chunk_size_ - chunk_used_, frame, complete);
    if (complete) return true;
  }
  return false;
}

bool Link::refill() {
  const size_t wanted = budget_ < kChunk ? budget_ : kChunk;
  if (wanted == 0) return false;
  chunk_used_ = 0;
  chunk_size_ = line_.read(chunk_, wanted);
  budget_ -= chunk_size_;
  return chunk_size_ > 0;
}

void Link::send_body(uint8_t id, const uint8_t* body, size_t size) {
  uint8_t frame[kMaxFrame];
  const size_t frame_size = encode_frame(id, seq_++, body, size, frame);
  if (line_.write(frame, frame_size)) {
    ++frames_sent_;
  } else {
    ++send_dropped_;
  }
}

bool Link::carries(uint32_t rate_hz, size_t body_size) const {
  const uint32_t capacity = line_.bytes_per_second();
  return capacity == 0 || rate_hz * frame_size(body_size) * 5 <= capacity * 4;
}

uint32_t Link::rate_beside(uint32_t taken, size_t body_size, uint32_t wanted_hz) const {
  const uint32_t capacity = line_.bytes_per_second();
  if (capacity == 0) return wanted_hz;
  const uint32_t usable = capacity / 5 * 4;
  const uint32_t left = taken < usable ? usable - taken : 0;
  const auto possible_hz = static_cast<uint32_t>(left / frame_size(body_size));
  return possible_hz < wanted_hz ? possible_hz : wanted_hz;
}

}  // namespace wheelwire
