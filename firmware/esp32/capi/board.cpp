// The check of a board, through the C interface.
#include "board_rules.hpp"
#include "wheelwire_core.h"

using wheelwire::BoardDescription;
using wheelwire::BoardFault;
using wheelwire::BoardIssue;

size_t wheelwire_board_check(const uint8_t* board, size_t size, wheelwire_board_issue* issues,
                             size_t capacity) {
  size_t count = 0;
  const auto report = [&](const BoardIssue& issue) {
    if (count < capacity) {
      issues[count] = {.value = issue.value,
                       .limit = issue.limit,
                       .pin = static_cast<int16_t>(issue.pin),
                       .fault = static_cast<uint8_t>(issue.fault),
                       .function = static_cast<uint8_t>(issue.function),
                       .other = static_cast<uint8_t>(issue.other)};
    }
    ++count;
  };
  BoardDescription description;
  const BoardFault damage = wheelwire::read_board(board, size, description);
  if (damage != BoardFault::kNone) {
    report(BoardIssue{.fault = damage});
  } else {
    wheelwire::check_board(description, report);
  }
  return count;
}
