// The lists of peripherals that hosts write; their pins are free on each board of the chip.
#pragma once

#include <array>

#include "peripherals.hpp"

namespace wheelwire::explore {

constexpr size_t kLists = 3;

/// None; two bumpers; a cliff sensor and the fault output of a power stage.
inline PeripheralList list_of(size_t which, uint32_t board) {
  PeripheralList list{.board = board};
  const auto add = [&list](Peripheral entry) { list.entries[list.count++] = entry; };
  if (which % kLists == 1) {
    add({.kind = PeripheralKind::kBumper, .place = Place::kFrontLeft, .pin_a = 36});
    add({.kind = PeripheralKind::kBumper, .place = Place::kRear, .pin_a = 39});
  } else if (which % kLists == 2) {
    add({.kind = PeripheralKind::kCliff, .place = Place::kFront, .pin_a = 36});
    add({.kind = PeripheralKind::kStageFault, .flags = peripheralflag::kTriggeredLow, .pin_a = 39});
  }
  return list;
}

/// What a hand, the floor or a power stage does to a sensor.
enum class Sensed : uint8_t { kFrontLeft, kFrontRight, kRear, kCliff, kStageFault, kCount };

}  // namespace wheelwire::explore
