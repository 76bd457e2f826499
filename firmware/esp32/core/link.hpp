// Messages over the line: framing in both directions, and counters of what was lost.
#pragma once

#include "framing.hpp"
#include "hal.hpp"

namespace wheelwire {

/// Only devices send messages from this id on.
constexpr uint8_t kFirstDeviceId = 0x80;

class Link {
 public:
  explicit Link(ByteStream& line) : line_(line), decoder_(received_body_size) {}

  /// Returns true with the next good frame for the device; false when no more are waiting. Reads at
  /// most kReadBudget bytes between two calls of `renew_read_budget`, so that a babbling line
  /// cannot hold up the control loop.
  bool receive(Frame& frame) {
    while (chunk_used_ < chunk_size_ || refill()) {
      bool complete;
      chunk_used_ +=
          decoder_.feed(chunk_ + chunk_used_, chunk_size_ - chunk_used_, frame, complete);
      if (complete) return true;
    }
    return false;
  }
  void renew_read_budget() { budget_ = kReadBudget; }
  void restart_sequence() { decoder_.restart_sequence(); }

  template <typename Message>
  void send(const Message& message) {
    uint8_t body[Message::kSize];
    message.encode(body);
    send_body(Message::kId, body, Message::kSize);
  }
  void send_body(uint8_t id, const uint8_t* body, size_t size) {
    uint8_t frame[kMaxFrame];
    const size_t frame_size = encode_frame(id, seq_++, body, size, frame);
    if (line_.write(frame, frame_size)) {
      ++frames_sent_;
    } else {
      ++send_dropped_;
    }
  }

  /// True if the line can carry `rate_hz` frames of this body size with a fifth to spare.
  bool carries(uint32_t rate_hz, size_t body_size) const {
    const uint32_t capacity = line_.bytes_per_second();
    return capacity == 0 || rate_hz * frame_size(body_size) * 5 <= capacity * 4;
  }
  /// How many frames a second of this body size the line carries in addition to `taken` bytes a
  /// second, with a fifth to spare; at most `wanted_hz`.
  uint32_t rate_beside(uint32_t taken, size_t body_size, uint32_t wanted_hz) const {
    const uint32_t capacity = line_.bytes_per_second();
    if (capacity == 0) return wanted_hz;
    const uint32_t usable = capacity / 5 * 4;
    const uint32_t left = taken < usable ? usable - taken : 0;
    const auto possible_hz = static_cast<uint32_t>(left / frame_size(body_size));
    return possible_hz < wanted_hz ? possible_hz : wanted_hz;
  }

  const ReceiveCounters& received() const { return decoder_.counters(); }
  uint32_t frames_sent() const { return frames_sent_; }
  uint32_t send_dropped() const { return send_dropped_; }

 private:
  /// Messages that only devices send are unknown to a device.
  static int received_body_size(uint8_t id) { return id < kFirstDeviceId ? body_size(id) : -1; }

  // Three times what arrives in a millisecond at 2 Mbit/s.
  static constexpr size_t kReadBudget = 600;
  static constexpr size_t kChunk = 64;

  bool refill() {
    const size_t wanted = budget_ < kChunk ? budget_ : kChunk;
    if (wanted == 0) return false;
    chunk_used_ = 0;
    chunk_size_ = line_.read(chunk_, wanted);
    budget_ -= chunk_size_;
    return chunk_size_ > 0;
  }

  ByteStream& line_;
  FrameDecoder decoder_;
  uint8_t chunk_[kChunk];
  size_t chunk_size_ = 0;
  size_t chunk_used_ = 0;
  size_t budget_ = kReadBudget;
  uint16_t seq_ = 0;
  uint32_t frames_sent_ = 0;
  uint32_t send_dropped_ = 0;
};

}  // namespace wheelwire
