// The lists of peripherals that hosts write; their pins are free on each board of the chip. The
// battery's levels can be used on a board with a divider alone: the simulated robot's own.
#pragma once

#include <array>

#include "peripherals.hpp"

namespace wheelwire::explore {

constexpr size_t kLists = 4;
constexpr size_t kBatteryList = 3;

constexpr uint16_t kWarnMv = 7000;
constexpr uint16_t kLimitMv = 6800;
constexpr uint16_t kStopMv = 6600;

/// None; two bumpers; a cliff sensor and the fault output of a power stage; a battery's levels.
inline PeripheralList list_of(size_t which, uint32_t board) {
  PeripheralList list{.board = board};
  const auto add = [&list](Peripheral entry) { list.entries[list.count++] = entry; };
  if (which % kLists == 1) {
    add({.kind = PeripheralKind::kBumper, .place = Place::kFrontLeft, .pin_a = 36});
    add({.kind = PeripheralKind::kBumper, .place = Place::kRear, .pin_a = 39});
  } else if (which % kLists == 2) {
    add({.kind = PeripheralKind::kCliff, .place = Place::kFront, .pin_a = 36});
    add({.kind = PeripheralKind::kStageFault, .flags = peripheralflag::kTriggeredLow, .pin_a = 39});
  } else if (which % kLists == kBatteryList) {
    add({.kind = PeripheralKind::kBattery,
         .value_a = kWarnMv,
         .value_b = kLimitMv,
         .value_c = kStopMv});
  }
  return list;
}

/// What a hand, the floor or a power stage does to a sensor.
enum class Sensed : uint8_t { kFrontLeft, kFrontRight, kRear, kCliff, kStageFault, kCount };

}  // namespace wheelwire::explore
