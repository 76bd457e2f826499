// Messages over the line: framing in both directions, and counters of what was lost.
#pragma once

#include "framing.hpp"
#include "hal.hpp"

namespace wheelwire {

/// Only devices send messages from this id on.
constexpr uint8_t kFirstDeviceId = 0x80;

class Link {
 public:
  explicit Link(ByteStream& line);

  /// Returns true with the next good frame for the device; false when no more are waiting. Reads at
  /// most kReadBudget bytes between two calls of `renew_read_budget`, so that a babbling line
  /// cannot hold up the control loop.
  bool receive(Frame& frame);
  void renew_read_budget() { budget_ = kReadBudget; }
  void restart_sequence() { decoder_.restart_sequence(); }

  template <typename Message>
  void send(const Message& message) {
    uint8_t body[Message::kSize];
    message.encode(body);
    send_body(Message::kId, body, Message::kSize);
  }
  void send_body(uint8_t id, const uint8_t* body, size_t size);

  /// True if the line can carry `rate_hz` frames of this body size with a fifth to spare.
  bool carries(uint32_t rate_hz, size_t body_size) const;
  /// How many frames a second of this body size the line carries in addition to `taken` bytes a
  /// second, with a fifth to spare; at most `wanted_hz`.
  uint32_t rate_beside(uint32_t taken, size_t body_size, uint32_t wanted_hz) const;

  const ReceiveCounters& received() const { return decoder_.counters(); }
  uint32_t frames_sent() const { return frames_sent_; }
  uint32_t send_dropped() const { return send_dropped_; }

 private:
  // Three times what arrives in a millisecond at 2 Mbit/s.
  static constexpr size_t kReadBudget = 600;
  static constexpr size_t kChunk = 64;

  bool refill();

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
