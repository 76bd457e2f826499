#include "peripherals.hpp"

#include <vector>

#include "built_in_boards.hpp"
#include "check.hpp"
#include "sensor_bench.hpp"

using namespace wheelwire;
using test::battery;
using test::bumper;
using test::list_of;
using enum PeripheralFault;

namespace {

/// The built-in board on a module that leaves GPIO 16 and 17 free.
BoardDescription wroom() {
  BoardDescription board = kBoardOfEsp32;
  board.module = Module::kWroom32;
  return board;
}

Peripheral imu() {
  return {.kind = PeripheralKind::kImu,
          .chip = SensorChip::kMpu6050,
          .pin_a = 16,
          .pin_b = 17,
          .pin_c = 35,
          .forward = Axis::kY,
          .up = Axis::kZ};
}

Peripheral power() {
  return {.kind = PeripheralKind::kPower,
          .chip = SensorChip::kIna219,
          .pin_a = 16,
          .pin_b = 17,
          .value_a = 1000};
}

template <typename Change>
Peripheral changed(Peripheral entry, Change change) {
  change(entry);
  return entry;
}

PeripheralFault fault_of(const BoardDescription& board, std::initializer_list<Peripheral> entries) {
  return first_issue(list_of(entries), board).fault;
}

PeripheralFault fault_of(std::initializer_list<Peripheral> entries) {
  return fault_of(wroom(), entries);
}

}  // namespace

TEST(peripherals_that_can_be_used) {
  CHECK(fault_of({imu(), power(), bumper(Place::kFront), bumper(Place::kFrontRight, 39),
                  battery(7000, 6800, 6400)}) == kNone);
  CHECK(fault_of(kBoardOfEsp32, {}) == kNone);
}

TEST(peripherals_by_the_pins_of_the_module) {
  CHECK(fault_of(kBoardOfEsp32, {imu()}) == kPinOfMemory);
}

TEST(each_rule_of_peripherals) {
  using Change = void (*)(Peripheral&);
  struct Case {
    PeripheralFault fault;
    Peripheral entry;
    Change change;
  };
  const Case cases[] = {
      {kKind, imu(), [](auto& e) { e.kind = PeripheralKind::kNone; }},
      {kKind, imu(), [](auto& e) { e.kind = static_cast<PeripheralKind>(99); }},
      {kChip, imu(), [](auto& e) { e.chip = SensorChip::kIna219; }},
      {kChip, power(), [](auto& e) { e.chip = SensorChip::kMpu6050; }},
      {kPlace, bumper(Place::kFront), [](auto& e) { e.place = Place::kNone; }},
      {kNormallyOpen, bumper(Place::kFront),
       [](auto& e) { e.flags = peripheralflag::kTriggeredLow; }},
      {kPinMissing, imu(), [](auto& e) { e.pin_a = -1; }},
      {kPinMissing, bumper(Place::kFront), [](auto& e) { e.pin_a = -1; }},
      {kPinAbsent, bumper(Place::kFront), [](auto& e) { e.pin_a = 37; }},
      {kPinTaken, bumper(Place::kFront), [](auto& e) { e.pin_a = 25; }},
      {kPinTaken, imu(), [](auto& e) { e.pin_b = e.pin_a; }},
      {kPinOfMemory, bumper(Place::kFront), [](auto& e) { e.pin_a = 6; }},
      {kPinOfLink, bumper(Place::kFront), [](auto& e) { e.pin_a = 3; }},
      {kPinStrapping, bumper(Place::kFront), [](auto& e) { e.pin_a = 12; }},
      {kPinInputOnly, imu(), [](auto& e) { e.pin_a = 34; }},
      {kNoPull, bumper(Place::kFront), [](auto& e) { e.flags = peripheralflag::kPullUp; }},
      {kOrientation, imu(), [](auto& e) { e.up = Axis::kMinusY; }},
      {kCode, imu(), [](auto& e) { e.up = static_cast<Axis>(6); }},
      {kCode, imu(), [](auto& e) { e.address = 0x78; }},
      {kShunt, power(), [](auto& e) { e.value_a = 0; }},
  };
  for (const Case& one : cases) CHECK(fault_of({changed(one.entry, one.change)}) == one.fault);
}

TEST(a_battery_needs_falling_bounds_and_something_that_measures_it) {
  BoardDescription board = wroom();
  CHECK(fault_of(board, {battery(7000, 6800, 6400)}) == kNoBattery);
  board.battery = 34;
  CHECK(fault_of(board, {battery(7000, 6800, 6400)}) == kNone);
  CHECK(fault_of(board, {battery(0, 0, 0)}) == kNone);
  CHECK(fault_of(board, {battery(7000, 7000, 6400)}) == kLevels);
  CHECK(fault_of(board, {battery(7000, 6800, 6800)}) == kLevels);
  CHECK(fault_of(board, {battery(7000, 6800, 0)}) == kLevels);
}

TEST(two_of_a_kind_at_one_place_or_at_one_address) {
  CHECK(fault_of({bumper(Place::kFront), bumper(Place::kFront, 39)}) == kTwice);
  CHECK(fault_of({imu(), changed(power(), [](auto& e) { e.address = 0x68; })}) == kTwice);
  CHECK(fault_of({bumper(Place::kFront), bumper(Place::kRear)}) == kPinTaken);
}

TEST(a_linux_computer_reads_no_peripherals) {
  BoardDescription board = wroom();
  board.chip = Board::kLinux;
  CHECK(fault_of(board, {bumper(Place::kFront)}) == kNotOnThisChip);
}

TEST(a_packed_list_is_read_back_and_each_bit_counts) {
  const PeripheralList list = list_of({imu(), bumper(Place::kRear)});
  uint8_t packed[PeripheralList::kSize];
  write_list(list, packed);
  PeripheralList found;
  CHECK(read_list(packed, sizeof packed, found) == kNone);
  CHECK(found.count == 2 && found.board == list.board);
  CHECK(found.entries[0] == list.entries[0] && found.entries[1] == list.entries[1]);
  CHECK(read_list(packed, sizeof packed - 1, found) == kDamaged);
  for (size_t i = 0; i < sizeof packed; ++i) {
    packed[i] ^= 0x10;
    CHECK(read_list(packed, sizeof packed, found) == kDamaged);
    packed[i] ^= 0x10;
  }
}
