#include "line.hpp"

#include <vector>

#include "check.hpp"

using namespace wheelwire::sim;

namespace {

void host_write(Line& line, size_t size) {
  const Bytes data(size, 0x55);
  line.host_write(data.data(), data.size());
}

size_t read_all(Line& line) {
  uint8_t buffer[2 * Line::kReceiveCapacity];
  return line.read(buffer, sizeof buffer);
}

struct Tap final : LineTap {
  std::vector<size_t> read;
  size_t written = 0;
  void on_read(const uint8_t*, size_t size) override { read.push_back(size); }
  void on_write(const uint8_t*, size_t size) override { written += size; }
};

}  // namespace

TEST(line_carries_no_faster_than_its_baud_rate) {
  Line line;
  line.set_baud(115200);
  CHECK(line.bytes_per_second() == 11520);
  host_write(line, 1000);
  line.carry(0.01, true);
  CHECK(read_all(line) == 115);
  line.carry(1.0, true);
  CHECK(read_all(line) == 885);
}

TEST(line_loses_and_counts_what_the_device_cannot_take) {
  Line line;
  host_write(line, Line::kReceiveCapacity + 10);
  line.carry(0.0, true);
  CHECK(line.lost_to_device() == 10);
  CHECK(read_all(line) == Line::kReceiveCapacity);
  host_write(line, 5);
  line.carry(0.0, false);
  CHECK(line.lost_to_device() == 15 && read_all(line) == 0);
}

TEST(line_takes_all_of_a_write_or_nothing) {
  Line line;
  line.set_baud(115200);
  const Bytes data(Line::kSendCapacity, 0x55);
  CHECK(line.write(data.data(), data.size() - 1));
  CHECK(!line.write(data.data(), 2));
  CHECK(line.write(data.data(), 1));
  line.carry(1.0, true);
  CHECK(line.host_waiting() == Line::kSendCapacity);
}

TEST(line_tells_when_the_next_wire_falls_idle) {
  Line line;
  const Bytes data(100, 0x55);
  CHECK(line.until_idle() == 0.0);
  line.set_baud(10'000);  // 1 ms a byte
  line.host_write(data.data(), 100);
  CHECK(line.until_idle() == 0.1);
  CHECK(line.write(data.data(), 20));
  CHECK(line.until_idle() == 0.02);
  line.carry(0.02, true);
  CHECK(line.until_idle() == 0.08);
  line.carry(line.until_idle(), true);
  CHECK(line.until_idle() == 0.0 && read_all(line) == 100);
}

TEST(a_tap_sees_one_frame_after_the_other_and_the_end) {
  Line line;
  Tap tap;
  line.set_tap(&tap);
  const uint8_t frames[] = {0, 1, 2, 0, 0, 3, 0};
  line.host_write(frames, sizeof frames);
  line.carry(0.0, true);
  uint8_t out[16];
  size_t total = 0;
  while (const size_t size = line.read(out, sizeof out)) total += size;
  CHECK(total == sizeof frames);
  CHECK((tap.read == std::vector<size_t>{1, 3, 1, 2, 0}));
  CHECK(line.write(frames, 4) && tap.written == 4);
}
