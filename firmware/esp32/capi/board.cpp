// The checks of a board and of its peripherals, through the C interface.
#include "configuration.hpp"
#include "wheelwire_core.h"

using namespace wheelwire;

size_t wheelwire_board_check(const uint8_t* packed, size_t size, wheelwire_board_issue* issues,
                             size_t capacity) {
  size_t count = 0;
  const auto report = [&](const BoardIssue& issue) {
    if (count++ >= capacity) return;
    *issues++ = {.value = issue.value,
                 .limit = issue.limit,
                 .pin = static_cast<int16_t>(issue.pin),
                 .fault = static_cast<uint8_t>(issue.fault),
                 .function = static_cast<uint8_t>(issue.function),
                 .other = static_cast<uint8_t>(issue.other)};
  };
  Configuration configuration;
  if (Configuration::decode(packed, size, configuration)) {
    check_board(configuration.board, report);
  } else {
    report(BoardIssue{.fault = BoardFault::kDamaged});
  }
  return count;
}

size_t wheelwire_peripherals_check(const uint8_t* packed, size_t size,
                                   wheelwire_peripheral_issue* issues, size_t capacity) {
  size_t count = 0;
  const auto report = [&](const PeripheralIssue& issue) {
    if (count++ >= capacity) return;
    *issues++ = {.value = issue.value,
                 .limit = issue.limit,
                 .channel = static_cast<int16_t>(issue.channel),
                 .pin = static_cast<int16_t>(issue.pin),
                 .fault = static_cast<uint8_t>(issue.fault)};
  };
  Configuration configuration;
  if (Configuration::decode(packed, size, configuration))
    check_peripherals(configuration.peripherals, configuration.board, report);
  return count;
}
