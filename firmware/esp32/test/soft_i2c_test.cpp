// The I2C bus by two pins, with a chip on them.
#include "soft_i2c.hpp"

#include <vector>

#include "check.hpp"
#include "pin_chip.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

/// Two wires with a chip on them. A look at a pin takes a microsecond, too.
class Wires final : public I2cLines {
 public:
  PinChip chip;
  bool clock_shorted = false;
  bool data_shorted = false;
  uint64_t stretch_us = 0;  ///< How long the clock stays low after its release.
  uint64_t time_us = 1000;
  int clocks = 0;

  void set_clock(bool high) override {
    if (high && !clock_) {
      ++clocks;
      held_until_us_ = time_us + stretch_us;
    }
    clock_ = high;
    look();
  }
  void set_data(bool high) override {
    data_ = high;
    look();
  }
  bool clock() override {
    ++time_us;
    look();
    return clock_level();
  }
  bool data() override {
    ++time_us;
    return data_level();
  }
  void wait() override {
    ++time_us;
    look();
  }
  uint64_t now_us() override { return time_us; }

  bool is_free() { return clock_level() && data_level(); }

 private:
  bool clock_level() const { return clock_ && !clock_shorted && time_us >= held_until_us_; }
  bool data_level() const { return data_ && !data_shorted && !chip.pulls_data; }
  void look() { chip.follow(clock_level(), data_level()); }

  bool clock_ = true;
  bool data_ = true;
  uint64_t held_until_us_ = 0;
};

bool reads_a_register(SoftI2c& bus, Wires& wires) {
  wires.chip.registers[7] = 42;
  uint8_t byte = 0;
  return bus.read(PinChip::kAddress, 7, &byte, 1) == I2cResult::kOk && byte == 42;
}

}  // namespace

TEST(registers_are_written_and_read_back_over_two_pins) {
  Wires wires;
  SoftI2c bus{wires};
  const uint8_t bytes[] = {0x1b, 0x08, 0xa5, 0xff, 0x00};
  CHECK(bus.write(PinChip::kAddress, bytes, sizeof bytes) == I2cResult::kOk);
  CHECK(wires.chip.registers[0x1b] == 0x08 && wires.chip.registers[0x1c] == 0xa5);
  CHECK(wires.chip.registers[0x1d] == 0xff && wires.chip.registers[0x1e] == 0x00);
  wires.chip.registers[0x1f] = 0x3c;
  uint8_t read[5]{};
  CHECK(bus.read(PinChip::kAddress, 0x1b, read, sizeof read) == I2cResult::kOk);
  CHECK(read[0] == 0x08 && read[1] == 0xa5 && read[2] == 0xff && read[3] == 0 && read[4] == 0x3c);
  CHECK(wires.is_free());
  CHECK(wires.chip.starts == 3 && wires.chip.stops == 2);  // The read has a repeated start.
}

TEST(an_address_without_a_chip_is_not_acknowledged) {
  Wires wires;
  SoftI2c bus{wires};
  uint8_t byte = 0;
  CHECK(bus.read(0x69, 0x75, &byte, 1) == I2cResult::kNoAcknowledge);
  CHECK(bus.write(0x69, &byte, 1) == I2cResult::kNoAcknowledge);
  CHECK(wires.chip.unacknowledged == std::vector<uint8_t>({0xd2, 0xd2}));
  CHECK(wires.is_free());
}

TEST(a_line_that_is_held_low_costs_no_more_than_the_limit) {
  for (const bool clock : {false, true}) {
    Wires wires;
    (clock ? wires.clock_shorted : wires.data_shorted) = true;
    SoftI2c bus{wires};
    const uint64_t start_us = wires.time_us;
    uint8_t byte = 0;
    CHECK(bus.read(PinChip::kAddress, 0, &byte, 1) == I2cResult::kHung);
    CHECK(wires.time_us - start_us <= I2cBus::kTransferUs + 10);
    bus.recover();
    CHECK(wires.time_us - start_us <= 2 * I2cBus::kTransferUs + 100);
    wires.clock_shorted = wires.data_shorted = false;
    bus.recover();
    CHECK(reads_a_register(bus, wires));
  }
}

TEST(a_chip_may_hold_the_clock_for_a_while) {
  Wires wires;
  SoftI2c bus{wires};
  wires.stretch_us = 50;
  CHECK(reads_a_register(bus, wires));
  wires.stretch_us = I2cBus::kTransferUs / 30;
  uint8_t byte = 0;
  CHECK(bus.read(PinChip::kAddress, 7, &byte, 1) == I2cResult::kHung);
}

/// A reset of this chip in the middle of a read leaves the other one waiting for clocks, with a
/// zero on the data line.
TEST(nine_clocks_free_a_chip_that_was_interrupted) {
  for (int clocks = 0; clocks < 9; ++clocks) {
    Wires wires;
    for (uint8_t& value : wires.chip.registers) value = 0;
    const auto pulse = [&wires](bool data) {
      wires.set_data(data);
      wires.set_clock(true);
      wires.set_clock(false);
    };
    wires.set_data(false);
    wires.set_clock(false);
    for (int i = 7; i >= 0; --i) pulse((PinChip::kAddress << 1 | 1) >> i & 1);
    pulse(true);  // Its acknowledge.
    for (int i = 0; i < clocks; ++i) pulse(true);
    wires.set_clock(true);
    SoftI2c bus{wires};
    uint8_t byte = 0;
    if (!wires.is_free()) CHECK(bus.read(PinChip::kAddress, 0, &byte, 1) == I2cResult::kHung);
    bus.recover();
    CHECK(wires.is_free());
    CHECK(reads_a_register(bus, wires));
  }
}
