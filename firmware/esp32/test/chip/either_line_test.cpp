#include "either_line.hpp"

#include "fake_line.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

constexpr uint32_t kUartRate = 92'160;

struct LinesBench {
  LinesBench() { uart.bytes.rate = kUartRate; }

  FakeLine uart;
  FakeLine usb;
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
  CHECK(bench.uart.bytes.to_host == Bytes{1} && bench.line.bytes_per_second() == kUartRate);
  bench.usb.bytes.to_device = {7, 8};
  CHECK(bench.hear() == Bytes({7, 8}));
  bench.say(2);
  CHECK(bench.usb.bytes.to_host == Bytes{2} && bench.line.bytes_per_second() == 0);
  CHECK(bench.hear().empty());
  bench.say(3);
  CHECK(bench.usb.bytes.to_host == Bytes({2, 3}));
  bench.uart.bytes.to_device = {9};
  CHECK(bench.hear() == Bytes{9});
  bench.say(4);
  CHECK(bench.uart.bytes.to_host == Bytes({1, 4}));
  // Bytes of both are not mixed in one read.
  bench.uart.bytes.to_device = {1, 2};
  bench.usb.bytes.to_device = {3};
  CHECK(bench.hear() == Bytes({1, 2}));
  CHECK(bench.hear() == Bytes{3});
}

TEST(both_lines_are_started_and_one_is_enough) {
  FakeLine good, bad;
  bad.starts = false;
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
