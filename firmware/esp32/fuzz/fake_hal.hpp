// Hardware that does what a fuzz input says, and checks what must always hold at these interfaces.
#pragma once

#include <algorithm>
#include <vector>

#include "drive_oracle.hpp"
#include "fixed.hpp"
#include "framing.hpp"
#include "hal.hpp"
#include "require.hpp"

namespace wheelwire::fuzz {

class FakeMotor final : public MotorPort {
 public:
  void drive(int16_t duty_q15) override {
    REQUIRE(duty_q15 >= -kFullDuty && duty_q15 <= kFullDuty);
    driven_ = duty_q15 != 0;
  }
  void brake() override { driven_ = false; }
  void coast() override { driven_ = false; }

  bool driven() const { return driven_; }

 private:
  bool driven_ = false;
};

/// Advances by a given number of ticks at each latch.
class FakeEncoders final : public EncoderPort {
 public:
  EncoderCounts latch() override {
    left_ = (left_ + left_ticks) % kCounterLimit;
    right_ = (right_ + right_ticks) % kCounterLimit;
    return {now_us, static_cast<int16_t>(left_), static_cast<int16_t>(right_)};
  }

  uint64_t now_us = 0;
  int left_ticks = 0;
  int right_ticks = 0;

 private:
  int left_ = 0;
  int right_ = 0;
};

/// Also passes what the firmware reads to the oracle.
class FakeLine final : public ByteStream {
 public:
  explicit FakeLine(DriveOracle& oracle) : oracle_(oracle) {}

  void arrive(const uint8_t* data, size_t size) {
    waiting_.insert(waiting_.end(), data, data + size);
  }

  size_t read(uint8_t* out, size_t capacity) override {
    const size_t size = std::min(capacity, waiting_.size() - read_);
    std::copy_n(waiting_.begin() + static_cast<ptrdiff_t>(read_), size, out);
    read_ += size;
    oracle_.read(out, size, now_us);
    return size;
  }

  bool write(const uint8_t* data, size_t size) override {
    FrameDecoder decoder(body_size);
    Frame frame{};
    int frames = 0;
    for (size_t i = 0; i < size; ++i) frames += decoder.feed(data[i], frame);
    REQUIRE(frames == 1 && frame.id >= 0x80);
    return !full;
  }

  uint32_t bytes_per_second() const override { return 92'160; }

  uint64_t now_us = 0;
  bool full = false;

 private:
  DriveOracle& oracle_;
  std::vector<uint8_t> waiting_;
  size_t read_ = 0;
};

class FakeEstop final : public EstopInput {
 public:
  bool is_open() override { return open; }
  bool open = false;
};

class FakeBattery final : public BatterySense {
 public:
  uint16_t millivolts() override { return 7400; }
};

}  // namespace wheelwire::fuzz
