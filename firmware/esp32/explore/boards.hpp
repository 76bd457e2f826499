// The boards that robots are wired by, and that hosts write.
#pragma once

#include <vector>

#include "configuration.hpp"
#include "own_board.hpp"
#include "sensors.hpp"
#include "shipped_boards.hpp"

namespace wheelwire::explore {

inline const std::vector<BoardDescription>& shipped_boards() {
  static const std::vector<BoardDescription> boards = [] {
    std::vector<BoardDescription> all;
    for (const sim::ShippedBoard& board : sim::kShippedBoards) all.push_back(board.board);
    return all;
  }();
  return boards;
}

/// The simulated robot's board while none is stored.
inline Configuration built_in_configuration(bool is_unwritten) {
  if (is_unwritten) return {.board = kBoardOfEsp32, .peripherals = {}};
  return {.board = sim::kOwnBoard, .peripherals = sim::default_peripherals()};
}

}  // namespace wheelwire::explore
