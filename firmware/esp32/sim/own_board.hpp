// The configuration of the simulated robot.
#pragma once

#include <algorithm>
#include <iterator>

#include "built_in_boards.hpp"
#include "configuration.hpp"

namespace wheelwire::sim {

/// The image's board on a module that leaves GPIO 16 and 17 to an IMU, and with a divider for the
/// battery: what its peripherals need.
constexpr BoardDescription own_board() {
  BoardDescription board = kBoardOfEsp32;
  constexpr char kName[] = "L298N, simulated";
  std::fill(std::begin(board.name), std::end(board.name), '\0');
  std::copy(std::begin(kName), std::end(kName), board.name);
  board.module = Module::kWroom32;
  board.battery = 34;
  return board;
}

inline constexpr BoardDescription kOwnBoard = own_board();
static_assert(first_issue(kOwnBoard).fault == BoardFault::kNone);

inline constexpr PeripheralList kOwnPeripherals{
    .count = 4,
    .entries = {
        {.kind = PeripheralKind::kImu,
         .chip = SensorChip::kMpu6050,
         .pin_a = 16,
         .pin_b = 17,
         .pin_c = 35,
         .forward = Axis::kY,
         .up = Axis::kZ},
        // Measured only: what voltage a simulated battery is empty at is for its user to say.
        {.kind = PeripheralKind::kBattery},
        {.kind = PeripheralKind::kBumper, .place = Place::kFrontLeft, .pin_a = 36},
        {.kind = PeripheralKind::kBumper, .place = Place::kFrontRight, .pin_a = 39},
    }};

/// While none is stored: its own, or that of a fresh chip.
inline constexpr Configuration kOwnConfiguration{.board = kOwnBoard,
                                                 .peripherals = kOwnPeripherals};
inline constexpr Configuration kUnwrittenConfiguration{.board = kBoardOfEsp32, .peripherals = {}};

}  // namespace wheelwire::sim
