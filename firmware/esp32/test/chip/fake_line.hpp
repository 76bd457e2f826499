// A line of the chip in memory.
#pragma once

#include "line.hpp"
#include "robot_bench.hpp"

namespace wheelwire::test {

class FakeLine : public Line {
 public:
  FakeLine() = default;
  explicit FakeLine(BenchLine& of) : bytes(of) {}

  bool start() override { return started = starts; }
  void notify(TaskHandle_t, uint32_t bits) override { notified = bits; }
  void push() override { ++pushes; }
  size_t read(uint8_t* out, size_t capacity) override { return bytes.read(out, capacity); }
  bool write(const uint8_t* data, size_t size) override { return bytes.write(data, size); }
  uint32_t bytes_per_second() const override { return bytes.bytes_per_second(); }

 private:
  BenchLine own_;

 public:
  BenchLine& bytes = own_;
  bool starts = true;
  bool started = false;
  uint32_t notified = 0;
  int pushes = 0;
};

}  // namespace wheelwire::test
