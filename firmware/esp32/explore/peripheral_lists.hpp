// The lists of peripherals that hosts write; their pins are free on each board of the chip. The
// battery's levels can be used on a board with a divider alone: the simulated robot's own.
#pragma once

#include <array>

#include "peripherals.hpp"

namespace wheelwire::explore {

constexpr size_t kLists = 8;
constexpr size_t kBatteryList = 3;

constexpr uint16_t kWarnMv = 7000;
constexpr uint16_t kLimitMv = 6800;
constexpr uint16_t kStopMv = 6600;

/// Whether a list has a battery's levels.
constexpr bool guards_battery(size_t which) { return which == kBatteryList || which > 5; }

/// An empty list; two bumpers; a cliff sensor and a power stage's fault output; a battery's levels;
/// and mixtures of these.
inline PeripheralList list_of(size_t which) {
  PeripheralList list;
  const auto add = [&list](Peripheral entry) { list.entries[list.count++] = entry; };
  const auto bumper = [&](Place place, int8_t pin) {
    add({.kind = PeripheralKind::kBumper, .place = place, .pin_a = pin});
  };
  const auto cliff = [&](int8_t pin) {
    add({.kind = PeripheralKind::kCliff, .place = Place::kFront, .pin_a = pin});
  };
  const auto stage = [&] {
    add({.kind = PeripheralKind::kStageFault, .flags = peripheralflag::kTriggeredLow, .pin_a = 39});
  };
  which %= kLists;
  if (which == 1) {
    bumper(Place::kFrontLeft, 36);
    bumper(Place::kRear, 39);
  } else if (which == 2) {
    cliff(36);
    stage();
  } else if (which == 4) {
    bumper(Place::kFrontLeft, 36);
    cliff(39);
  } else if (which == 5) {
    bumper(Place::kFrontRight, 36);
    stage();
  } else if (which == 6) {
    cliff(36);
    bumper(Place::kRear, 39);
  } else if (which == 7) {
    bumper(Place::kFrontLeft, 36);
    stage();
  }
  if (guards_battery(which))
    add({.kind = PeripheralKind::kBattery,
         .value_a = kWarnMv,
         .value_b = kLimitMv,
         .value_c = kStopMv});
  return list;
}

/// What a hand, the floor or a power stage does to a sensor.
enum class Sensed : uint8_t { kFrontLeft, kFrontRight, kRear, kCliff, kStageFault, kCount };

}  // namespace wheelwire::explore
