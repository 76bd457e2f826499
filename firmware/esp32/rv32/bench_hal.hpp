// The simplest robot that drives: wheels that follow their duty, and a line without errors.
#pragma once

#include <string.h>

#include "fixed.hpp"
#include "framing.hpp"
#include "given_ports.hpp"

namespace wheelwire::rv32 {

/// A motor with a first-order lag behind an L298N, and its encoder.
class BenchWheel final : public StagePort {
 public:
  void set(const StageOutputs& outputs) override {
    direction_ = (outputs[StageInput::kIn1] != 0) - (outputs[StageInput::kIn2] != 0);
    duty_q15_ = outputs[StageInput::kEnable];
  }

  /// Advances by one millisecond.
  void turn() {
    const int64_t wanted_umps = static_cast<int64_t>(kNoLoad_umps) * direction_ * duty_q15_;
    speed_umps_ += static_cast<int32_t>(wanted_umps / kFullDuty - speed_umps_) / kLag_ms;
    travel_nm_ += speed_umps_;
  }

  int16_t counter() const { return static_cast<int16_t>(travel_nm_ / kTick_nm % kCounterLimit); }

 private:
  static constexpr int32_t kNoLoad_umps = 691'000;
  static constexpr int32_t kLag_ms = 100;
  static constexpr int64_t kTick_nm = 576'000;

  int direction_ = 0;
  int32_t duty_q15_ = 0;
  int32_t speed_umps_ = 0;
  int64_t travel_nm_ = 0;
};

class BenchEncoders final : public EncoderPort {
 public:
  BenchEncoders(const BenchWheel& left, const BenchWheel& right) : left_(left), right_(right) {}

  /// Not counted.
  void sample(uint64_t now_us) { counts_ = {now_us, left_.counter(), right_.counter()}; }
  EncoderCounts latch() override { return counts_; }

 private:
  const BenchWheel& left_;
  const BenchWheel& right_;
  EncoderCounts counts_{};
};

/// Copies what a driver would copy, one frame each way.
class BenchLine final : public ByteStream {
 public:
  template <typename Message>
  void arrive(const Message& message) {
    uint8_t body[Message::kSize];
    message.encode(body);
    arrived_ = encode_frame(Message::kId, seq_++, body, sizeof body, in_);
  }

  size_t read(uint8_t* out, size_t capacity) override {
    const size_t size = arrived_ < capacity ? arrived_ : 0;
    memcpy(out, in_, size);
    arrived_ -= size;
    return size;
  }
  bool write(const uint8_t* data, size_t size) override {
    memcpy(out_, data, size);
    written_ = size;
    return true;
  }
  uint32_t bytes_per_second() const override { return 0; }

  /// The frame that was written since the last `take`, if any.
  bool newest(Frame& frame) const {
    FrameDecoder decoder(body_size);
    bool complete = false;
    for (size_t i = 0; i < written_; ++i) complete |= decoder.feed(out_[i], frame);
    return complete;
  }

  /// True when a `Message` was written since the last call; it is then in `message`.
  template <typename Message>
  bool take(Message& message) {
    Frame frame{};
    const bool complete = newest(frame);
    written_ = 0;
    if (!complete || frame.id != Message::kId) return false;
    message = Message::decode(frame.body);
    return true;
  }

 private:
  alignas(4) uint8_t in_[kMaxFrame];
  alignas(4) uint8_t out_[kMaxFrame];
  size_t arrived_ = 0;
  size_t written_ = 0;
  uint16_t seq_ = 0;
};

class ReleasedEstop final : public EstopInput {
 public:
  bool is_open() override { return false; }
};

class BenchBattery final : public BatterySense {
 public:
  uint16_t millivolts() override { return 7400; }
};

}  // namespace wheelwire::rv32
