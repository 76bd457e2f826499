// The boards that robots are wired by, and that hosts write.
#pragma once

#include <vector>

#include "built_in_boards.hpp"
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

/// The simulator's image has this one.
inline const BoardDescription& built_in_board() { return kBoardOfEsp32; }

}  // namespace wheelwire::explore
