// The lists of peripherals that hosts write; their pins are free on each board of the chip. The
// battery's levels can be used on a board with a divider alone: the simulated robot's own.
#pragma once

#include <algorithm>
#include <iterator>

#include "peripherals.hpp"

namespace wheelwire::explore {

constexpr uint16_t kWarnMv = 7000;
constexpr uint16_t kLimitMv = 6800;
constexpr uint16_t kStopMv = 6600;

constexpr Peripheral bumper(Place place, int8_t pin) {
  return {.kind = PeripheralKind::kBumper, .place = place, .pin_a = pin};
}
constexpr Peripheral cliff(int8_t pin) {
  return {.kind = PeripheralKind::kCliff, .place = Place::kFront, .pin_a = pin};
}
constexpr Peripheral kStageOutput{
    .kind = PeripheralKind::kStageFault, .flags = peripheralflag::kTriggeredLow, .pin_a = 39};
constexpr Peripheral kBatteryLevels{
    .kind = PeripheralKind::kBattery, .value_a = kWarnMv, .value_b = kLimitMv, .value_c = kStopMv};

constexpr PeripheralList kListed[] = {
    {},
    {2, {bumper(Place::kFrontLeft, 36), bumper(Place::kRear, 39)}},
    {2, {cliff(36), kStageOutput}},
    {1, {kBatteryLevels}},
    {2, {bumper(Place::kFrontLeft, 36), cliff(39)}},
    {2, {bumper(Place::kFrontRight, 36), kStageOutput}},
    {3, {cliff(36), bumper(Place::kRear, 39), kBatteryLevels}},
    {3, {bumper(Place::kFrontLeft, 36), kStageOutput, kBatteryLevels}},
};
constexpr size_t kLists = std::size(kListed);
constexpr size_t kBatteryList = 3;

/// Whether it has a battery's levels: the board has to measure the battery.
constexpr bool has_levels(const PeripheralList& list) {
  return std::any_of(list.begin(), list.end(), [](const Peripheral& entry) {
    return entry.kind == PeripheralKind::kBattery;
  });
}

/// What a hand, the floor or a power stage does to a sensor.
enum class Sensed : uint8_t { kFrontLeft, kFrontRight, kRear, kCliff, kStageFault, kCount };

}  // namespace wheelwire::explore
