#include "either_line.hpp"

#include <algorithm>
#include <vector>

#include "check.hpp"

using namespace wheelwire;

namespace {

/// A line in memory.
class MemoryLine final : public Line {
 public:
  explicit MemoryLine(bool starts = true, uint32_t rate = 0) : starts_(starts), rate_(rate) {}

  bool start() override { return started = starts_; }
  void notify(TaskHandle_t, uint32_t bits) override { notified = bits; }
  void push() override { ++pushes; }
  size_t read(uint8_t* out, size_t capacity) override {
    const size_t size = std::min(capacity, arrived.size());
    std::copy_n(arrived.begin(), size, out);
    arrived.erase(arrived.begin(), arrived.begin() + static_cast<std::ptrdiff_t>(size));
    return size;
  }
  bool write(const uint8_t* data, size_t size) override {
    written.insert(written.end(), data, data + size);
    return true;
  }
  uint32_t bytes_per_second() const override { return rate_; }

  std::vector<uint8_t> arrived, written;
  bool started = false;
  uint32_t notified = 0;
  int pushes = 0;

 private:
  bool starts_;
  uint32_t rate_;
};

constexpr uint32_t kUartRate = 92'160;

struct LinesBench {
  MemoryLine uart{true, kUartRate};
  MemoryLine usb;
  EitherLine line{uart, usb};

  void say(uint8_t byte) { CHECK(line.write(&byte, 1)); }
  std::vector<uint8_t> hear() {
    uint8_t bytes[8];
    const size_t size = line.read(bytes, sizeof bytes);
    return {bytes, bytes + size};
  }
};

using Bytes = std::vector<uint8_t>;

}  // namespace

TEST(it_speaks_on_the_line_that_was_heard_last) {
  LinesBench bench;
  bench.say(1);
  CHECK(bench.uart.written == Bytes{1} && bench.line.bytes_per_second() == kUartRate);
  bench.usb.arrived = {7, 8};
  CHECK(bench.hear() == Bytes({7, 8}));
  bench.say(2);
  CHECK(bench.usb.written == Bytes{2} && bench.line.bytes_per_second() == 0);
  CHECK(bench.hear().empty());
  bench.say(3);
  CHECK(bench.usb.written == Bytes({2, 3}));
  bench.uart.arrived = {9};
  CHECK(bench.hear() == Bytes{9});
  bench.say(4);
  CHECK(bench.uart.written == Bytes({1, 4}));
}

TEST(bytes_of_two_lines_are_not_mixed_in_one_read) {
  LinesBench bench;
  bench.uart.arrived = {1, 2};
  bench.usb.arrived = {3};
  CHECK(bench.hear() == Bytes({1, 2}));
  CHECK(bench.hear() == Bytes{3});
}

TEST(both_lines_are_started_and_one_is_enough) {
  MemoryLine good, bad{false};
  EitherLine first_fails{bad, good};
  EitherLine second_fails{good, bad};
  EitherLine both_fail{bad, bad};
  CHECK(first_fails.start() && good.started);
  CHECK(second_fails.start());
  CHECK(!both_fail.start());
}

TEST(both_lines_wake_the_task_and_are_pushed) {
  LinesBench bench;
  bench.line.notify(nullptr, 2);
  bench.line.push();
  CHECK(bench.uart.notified == 2 && bench.usb.notified == 2);
  CHECK(bench.uart.pushes == 1 && bench.usb.pushes == 1);
}
