#include "peripherals.hpp"

#include <vector>

#include "built_in_boards.hpp"
#include "sensor_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;
using enum PeripheralFault;

namespace {

/// The built-in board on a module that leaves GPIO 16 and 17 free.
BoardDescription wroom() {
  BoardDescription board = kBoardOfEsp32;
  board.module = Module::kWroom32;
  return board;
}

Peripheral analog(uint16_t number = 1, int8_t pin = 34) {
  return {.kind = PeripheralKind::kAnalog, .pin_a = pin, .value_a = 2000, .value_b = number};
}

Peripheral changed(Peripheral entry, auto change) {
  change(entry);
  return entry;
}

PeripheralFault fault_of(const BoardDescription& board, std::initializer_list<Peripheral> entries) {
  return first_issue(list_of(entries), board).fault;
}

PeripheralFault fault_of(std::initializer_list<Peripheral> entries) {
  return fault_of(wroom(), entries);
}

/// All issues of this fault.
std::vector<PeripheralIssue> issues_of(const PeripheralList& list, PeripheralFault fault) {
  std::vector<PeripheralIssue> found;
  check_peripherals(list, wroom(), [&](const PeripheralIssue& issue) {
    if (issue.fault == fault) found.push_back(issue);
  });
  return found;
}

/// A computer with the pins of a header.
BoardDescription pi() {
  BoardDescription board = wroom();
  board.chip = Chip::kLinux;
  return board;
}

/// On the bus of a computer with this number.
Peripheral on_bus(Peripheral entry, int8_t number) {
  entry.pin_a = number;
  entry.pin_b = entry.pin_c = -1;
  return entry;
}

}  // namespace

TEST(peripherals_that_can_be_used) {
  CHECK(fault_of({kImu, kPowerSensor, bumper(Place::kFront), bumper(Place::kFrontRight, 39),
                  battery(7000, 6800, 6400)}) == kNone);
  CHECK(fault_of(kBoardOfEsp32, {}) == kNone);
  CHECK(fault_of(kBoardOfEsp32, {kImu}) == kPinOfMemory);  // Its module needs these pins.
  CHECK(fault_of({kRangeSensor, analog(1, 35), analog(4, 36)}) == kNone);
  CHECK(fault_of(kBoardOfEsp32, {kRangeSensor, analog(2, 39)}) == kNone);
}

TEST(an_imu_may_have_any_bias_and_a_range_sensor_any_side_but_no_bumper) {
  for (const uint16_t counts : std::initializer_list<uint16_t>{1, 0x7fff, 0x8000, 0xffff})
    CHECK(fault_of({changed(
              kImu, [counts](auto& e) { e.value_a = e.value_b = e.value_c = counts; })}) == kNone);
  for (const Place place : {Place::kFront, Place::kRearLeft, Place::kLeft, Place::kRight})
    CHECK(fault_of({changed(kRangeSensor, [place](auto& e) { e.place = place; })}) == kNone);
  for (const Place place : {Place::kLeft, Place::kRight})
    CHECK(fault_of({bumper(place)}) == kPlace);
}

/// The board has no more pins that drive than two: what is taken is not what is asked here.
TEST(there_are_as_many_range_sensors_as_the_chip_times_echoes) {
  PeripheralList list = list_of({});
  for (const Place place : {Place::kFront, Place::kRear, Place::kLeft, Place::kRight}) {
    list.entries[list.count] = kRangeSensor;
    list.entries[list.count++].place = place;
    const auto too_many = issues_of(list, kTooManyRanges);
    CHECK(too_many.empty() == (list.count < 4));
    for (const PeripheralIssue& issue : too_many)
      CHECK(issue.channel == 3 && issue.limit == kMostRanges);
  }
}

TEST(each_rule_of_peripherals) {
  using Change = void (*)(Peripheral&);
  const struct {
    PeripheralFault fault;
    Peripheral entry;
    Change change;
  } cases[] = {
      {kKind, kImu, [](auto& e) { e.kind = PeripheralKind::kNone; }},
      {kKind, kImu, [](auto& e) { e.kind = static_cast<PeripheralKind>(99); }},
      {kChip, kImu, [](auto& e) { e.chip = SensorChip::kIna219; }},
      {kChip, kPowerSensor, [](auto& e) { e.chip = SensorChip::kMpu6050; }},
      {kPlace, bumper(Place::kFront), [](auto& e) { e.place = Place::kNone; }},
      {kNormallyOpen, bumper(Place::kFront),
       [](auto& e) { e.flags = peripheralflag::kTriggeredLow; }},
      {kPinMissing, kImu, [](auto& e) { e.pin_a = -1; }},
      {kPinMissing, bumper(Place::kFront), [](auto& e) { e.pin_a = -1; }},
      {kPinAbsent, bumper(Place::kFront), [](auto& e) { e.pin_a = 37; }},
      {kPinTaken, bumper(Place::kFront), [](auto& e) { e.pin_a = 25; }},
      {kPinTaken, kImu, [](auto& e) { e.pin_b = e.pin_a; }},
      {kPinTaken, kImu, [](auto& e) { e.pin_c = e.pin_a; }},
      {kPinTaken, kImu, [](auto& e) { e.pin_c = e.pin_b; }},
      {kPinOfMemory, bumper(Place::kFront), [](auto& e) { e.pin_a = 6; }},
      {kPinOfLink, bumper(Place::kFront), [](auto& e) { e.pin_a = 3; }},
      {kPinStrapping, bumper(Place::kFront), [](auto& e) { e.pin_a = 12; }},
      {kPinInputOnly, kImu, [](auto& e) { e.pin_a = 34; }},
      {kNoPull, bumper(Place::kFront), [](auto& e) { e.flags = peripheralflag::kPullUp; }},
      {kOrientation, kImu, [](auto& e) { e.up = Axis::kMinusY; }},
      {kCode, kImu, [](auto& e) { e.up = static_cast<Axis>(6); }},
      {kCode, kImu, [](auto& e) { e.address = 0x78; }},
      {kShunt, kPowerSensor, [](auto& e) { e.value_a = 0; }},
      {kCode, bumper(Place::kFront),
       [](auto& e) {
         e.kind = PeripheralKind::kCliff;
         e.place = static_cast<Place>(9);
       }},
      {kChip, kRangeSensor, [](auto& e) { e.chip = SensorChip::kMpu6050; }},
      {kChip, kImu, [](auto& e) { e.chip = SensorChip::kHcSr04; }},
      {kPlace, kRangeSensor, [](auto& e) { e.place = Place::kNone; }},
      {kPinInputOnly, kRangeSensor, [](auto& e) { e.pin_a = 35; }},
      {kPinMissing, kRangeSensor, [](auto& e) { e.pin_a = -1; }},
      {kPinMissing, kRangeSensor, [](auto& e) { e.pin_b = -1; }},
      {kPinTaken, kRangeSensor, [](auto& e) { e.pin_b = e.pin_a; }},
      {kPinTaken, kRangeSensor, [](auto& e) { e.pin_a = 25; }},
      {kPinStrapping, kRangeSensor, [](auto& e) { e.pin_b = 12; }},
      {kNoAdc, analog(), [](auto& e) { e.pin_a = 21; }},
      {kPinMissing, analog(), [](auto& e) { e.pin_a = -1; }},
      {kPinTaken, analog(), [](auto& e) { e.pin_a = 33; }},
      {kDivider, analog(), [](auto& e) { e.value_a = 999; }},
      {kDivider, analog(), [](auto& e) { e.value_a = 20'001; }},
      {kCode, analog(), [](auto& e) { e.value_b = 0; }},
      {kCode, analog(), [](auto& e) { e.value_b = 5; }},
  };
  for (const auto& one : cases) CHECK(fault_of({changed(one.entry, one.change)}) == one.fault);
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

TEST(a_pin_that_is_missing_is_not_taken) {
  for (Peripheral entry : {kImu, kPowerSensor, kRangeSensor}) {
    entry.pin_a = entry.pin_b = entry.pin_c = -1;
    CHECK(issues_of(list_of({entry}), kPinTaken).empty() && fault_of({entry}) == kPinMissing);
  }
}

TEST(two_of_a_kind_at_one_place_or_at_one_address) {
  CHECK(fault_of({bumper(Place::kFront), bumper(Place::kFront, 39)}) == kTwice);
  CHECK(fault_of({kImu, changed(kPowerSensor, [](auto& e) { e.address = 0x68; })}) == kTwice);
  BoardDescription board = wroom();
  board.led = -1;
  CHECK(fault_of(board, {kImu, changed(kPowerSensor, [](auto& e) {
                           e.address = 0x68;
                           e.pin_a = 21;
                           e.pin_b = 22;
                         })}) == kNone);
  CHECK(fault_of({bumper(Place::kFront), bumper(Place::kRear)}) == kPinTaken);
  CHECK(fault_of({kRangeSensor, changed(kRangeSensor, [](auto& e) {
                    e.pin_a = 16;
                    e.pin_b = 35;
                  })}) == kTwice);
  CHECK(fault_of({analog(2), analog(2, 35)}) == kTwice);
  CHECK(fault_of({analog(1), analog(2)}) == kPinTaken);
  CHECK(fault_of({kRangeSensor, analog()}) == kPinTaken);
}

TEST(a_computer_has_its_buses_by_number_times_no_echoes_and_measures_no_voltage) {
  CHECK(fault_of(pi(), {on_bus(kImu, 1), on_bus(kPowerSensor, 1), bumper(Place::kFront, 8)}) ==
        kNone);
  CHECK(fault_of(pi(), {on_bus(kImu, 0), on_bus(kPowerSensor, 3), battery(9000, 8000, 7000)}) ==
        kNone);
  CHECK(fault_of(pi(), {kImu}) == kBus);
  CHECK(fault_of({on_bus(kImu, 1)}) == kBus);
  CHECK(fault_of(pi(), {on_bus(kImu, -1)}) == kPinMissing);
  CHECK(fault_of(pi(), {changed(on_bus(kImu, 1), [](auto& e) { e.pin_c = 7; })}) == kNotOnThisChip);
  CHECK(fault_of(pi(), {on_bus(kImu, 1), changed(on_bus(kPowerSensor, 1),
                                                 [](auto& e) { e.address = 0x68; })}) == kTwice);
  CHECK(fault_of(pi(), {battery(9000, 8000, 7000)}) == kNoBattery);
  for (const PeripheralKind kind : {PeripheralKind::kRange, PeripheralKind::kAnalog})
    CHECK(fault_of(pi(), {{.kind = kind, .pin_a = 8}}) == kNotOnThisChip);
}

TEST(the_header_s_bus_has_two_of_a_computer_s_pins) {
  for (const int8_t pin : {int8_t{2}, int8_t{3}}) {
    CHECK(fault_of(pi(), {on_bus(kImu, 1), bumper(Place::kFront, pin)}) == kPinTaken);
    CHECK(fault_of(pi(), {bumper(Place::kFront, pin), on_bus(kImu, 1)}) == kPinTaken);
    CHECK(fault_of(pi(), {on_bus(kImu, 3), bumper(Place::kFront, pin)}) == kNone);
    BoardDescription with_contact = pi();
    with_contact.estop = pin;
    CHECK(fault_of(with_contact, {on_bus(kImu, 1)}) == kPinTaken);
  }
  // The number of a bus is not a pin.
  CHECK(fault_of(pi(), {on_bus(kImu, 7), bumper(Place::kFront, 7)}) == kNone);
}
