// The boards that robots are wired by, and that hosts write.
#pragma once

#include <vector>

#include "own_board.hpp"
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

/// What the simulated robot is on while no board is stored.
inline const BoardDescription& built_in_board(bool is_unwritten) {
  return is_unwritten ? kBoardOfEsp32 : sim::kOwnBoard;
}

}  // namespace wheelwire::explore
