// The line of the self-test image: what a host asks the self-test is answered here. All else goes
// on to the firmware's core, which knows nothing of it.
#pragma once

#include "framing.hpp"
#include "line.hpp"
#include "self_test.hpp"

namespace wheelwire {

/// Both ends count the frames of the other: they miss those that the self-test took, and find its
/// answers out of order.
class SelfTestLine final : public Line {
 public:
  SelfTestLine(Line& line, SelfTest& self_test) : line_(line), self_test_(self_test) {}

  bool start() override { return line_.start(); }
  void notify(TaskHandle_t task, uint32_t bits) override { line_.notify(task, bits); }
  void push() override { line_.push(); }

  size_t read(uint8_t* out, size_t capacity) override {
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
  bool write(const uint8_t* data, size_t size) override { return line_.write(data, size); }
  uint32_t bytes_per_second() const override { return line_.bytes_per_second(); }

 private:
  void take(uint8_t byte) {
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
  bool serve(const Frame& frame) {
    if (frame.id == GroupGet::kId &&
        static_cast<uint8_t>(GroupGet::decode(frame.body).group) != kSelfTestGroup)
      return false;
    const uint8_t* in = frame.body;
    const auto session_id = wire::take<uint32_t>(in);
    const auto request_id = wire::take<uint16_t>(in);
    const bool is_repeat =
        answer_.size > 0 && session_id == session_id_ && request_id == request_id_;
    if (!is_repeat) {
      session_id_ = session_id;
      request_id_ = request_id;
      answer_ = self_test_.serve(frame, session_id, request_id);
    }
    uint8_t encoded[kMaxFrame];
    line_.write(encoded, encode_frame(answer_.id, seq_++, answer_.body, answer_.size, encoded));
    return true;
  }
  static int body_size_of_question(uint8_t id) {
    if (id == GroupGet::kId) return GroupGet::kSize;
    return id < 0x80 ? self_test_body_size(id) : -1;
  }

  Line& line_;
  SelfTest& self_test_;
  FrameDecoder decoder_{body_size_of_question};
  uint8_t chunk_[64];
  size_t chunk_size_ = 0;
  size_t chunk_used_ = 0;
  /// The frame that is arriving; once it is whole, `passed_` of its bytes have gone on.
  uint8_t held_[kMaxFrame];
  size_t held_size_ = 0;
  bool is_whole_ = false;
  size_t passed_ = 0;
  SelfTestAnswer answer_;  ///< Of the last question, which had these two fields.
  uint32_t session_id_ = 0;
  uint16_t request_id_ = 0;
  uint16_t seq_ = 0;
};

}  // namespace wheelwire
