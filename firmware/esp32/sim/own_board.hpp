// The board of the simulated robot.
#pragma once

#include <algorithm>
#include <iterator>

#include "built_in_boards.hpp"

namespace wheelwire::sim {

/// The image's board on a module that leaves GPIO 16 and 17 to an IMU, and with a divider for the
/// battery: what `default_peripherals` needs.
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

}  // namespace wheelwire::sim
