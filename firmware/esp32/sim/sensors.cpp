#include "sensors.hpp"

#include "board.hpp"
#include "built_in_boards.hpp"

namespace wheelwire::sim {

PeripheralList default_peripherals() {
  PeripheralList list{.count = 4, .board = fingerprint(kBoardOfEsp32)};
  list.entries[0] = {.kind = PeripheralKind::kImu,
                     .chip = SensorChip::kMpu6050,
                     .pin_a = 16,
                     .pin_b = 17,
                     .pin_c = 35,
                     .forward = Axis::kY,
                     .up = Axis::kZ};
  // Measured only: what voltage a simulated battery is empty at is for its user to say.
  list.entries[1] = {.kind = PeripheralKind::kBattery};
  list.entries[2] = {.kind = PeripheralKind::kBumper, .place = Place::kFrontLeft, .pin_a = 36};
  list.entries[3] = {.kind = PeripheralKind::kBumper, .place = Place::kFrontRight, .pin_a = 39};
  return list;
}

bool Sensors::is_triggered(const Peripheral& entry) const {
  const auto place = static_cast<size_t>(entry.place);
  switch (entry.kind) {
    case PeripheralKind::kBumper:
      return bumpers[place];
    case PeripheralKind::kCliff:
      return cliffs[place];
    default:
      return stage_fault;
  }
}

uint16_t Sensors::levels() {
  uint16_t levels = 0;
  for (size_t i = 0; i < list_.count; ++i) {
    const Peripheral& entry = list_.entries[i];
    if (!is_digital_input(entry.kind)) continue;
    const bool low_triggers = (entry.flags & peripheralflag::kTriggeredLow) != 0;
    // What is open is high.
    const bool is_high = !board_.is_free(entry.pin_a) || is_triggered(entry) != low_triggers;
    if (is_high) levels |= static_cast<uint16_t>(1u << i);
  }
  return levels;
}

}  // namespace wheelwire::sim
