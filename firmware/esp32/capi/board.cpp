// The checks of a board and of its peripherals, through the C interface.
#include "peripherals.hpp"
#include "wheelwire_core.h"

using wheelwire::BoardDescription;
using wheelwire::BoardFault;
using wheelwire::BoardIssue;
using wheelwire::PeripheralFault;
using wheelwire::PeripheralIssue;
using wheelwire::PeripheralList;

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

size_t wheelwire_peripherals_check(const uint8_t* list, size_t list_size, const uint8_t* board,
                                   size_t board_size, wheelwire_peripheral_issue* issues,
                                   size_t capacity) {
  size_t count = 0;
  const auto report = [&](const PeripheralIssue& issue) {
    if (count < capacity) {
      issues[count] = {.value = issue.value,
                       .limit = issue.limit,
                       .channel = static_cast<int16_t>(issue.channel),
                       .pin = static_cast<int16_t>(issue.pin),
                       .fault = static_cast<uint8_t>(issue.fault)};
    }
    ++count;
  };
  PeripheralList peripherals;
  BoardDescription description;
  const PeripheralFault damage = wheelwire::read_list(list, list_size, peripherals);
  if (damage != PeripheralFault::kNone) {
    report(PeripheralIssue{.fault = damage});
  } else if (wheelwire::read_board(board, board_size, description) != BoardFault::kNone ||
             wheelwire::fingerprint(description) != peripherals.board) {
    report(PeripheralIssue{.fault = PeripheralFault::kOtherBoard});
  } else {
    wheelwire::check_peripherals(peripherals, description, report);
  }
  return count;
}
