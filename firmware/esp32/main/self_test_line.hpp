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

  size_t read(uint8_t* out, size_t capacity) override;
  bool write(const uint8_t* data, size_t size) override { return line_.write(data, size); }
  uint32_t bytes_per_second() const override { return line_.bytes_per_second(); }

 private:
  void take(uint8_t byte);
  bool serve(const Frame& frame);
  static int body_size_of_question(uint8_t id);

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
