// A board for each power stage, on the pins of an ESP32.
#pragma once

#include "built_in_boards.hpp"
#include "gpio_matrix.hpp"

namespace wheelwire::test {

constexpr BoardDescription board_of(Stage stage) {
  BoardDescription board = kBoardOfEsp32;
  board.stage = stage;
  const StageTable& table = *table_of(stage);
  for (int8_t* pin : {&board.left_enable, &board.left_in1, &board.left_in2, &board.left_pwm,
                      &board.left_dir, &board.right_enable, &board.right_in1, &board.right_in2,
                      &board.right_pwm, &board.right_dir})
    *pin = -1;
  const bool has[] = {(table.inputs & 1) != 0, (table.inputs & 2) != 0, (table.inputs & 4) != 0,
                      (table.inputs & 8) != 0, (table.inputs & 16) != 0};
  if (has[0]) board.left_enable = 25, board.right_enable = 33;
  if (has[1]) board.left_in1 = 26, board.right_in1 = 32;
  if (has[2]) board.left_in2 = 27, board.right_in2 = 4;
  if (has[3]) board.left_pwm = 25, board.right_pwm = 33;
  if (has[4]) board.left_dir = 26, board.right_dir = 32;
  if (table.has_standby) board.standby = 21;
  board.pulldowns = table.pull_downs != 0 ? mask_of(25) | mask_of(33) : 0;
  return board;
}

constexpr bool all_can_be_used() {
  for (size_t i = 0; i < kStages; ++i)
    if (first_issue(board_of(static_cast<Stage>(i))).fault != BoardFault::kNone) return false;
  return true;
}
static_assert(all_can_be_used());

/// Calls `test` with a board of each stage.
void on_every_stage(auto test) {
  for (size_t i = 0; i < kStages; ++i) test(board_of(static_cast<Stage>(i)));
}

/// The pins that the chip drives.
inline PinMask driven_pins() {
  PinMask pins = 0;
  for (int pin = 0; pin < 40; ++pin)
    if (fake_matrix.enabled[pin]) pins |= mask_of(pin);
  return pins;
}
/// The pins that are high at some time of a PWM period.
inline PinMask high_pins() {
  PinMask pins = 0;
  for (int pin = 0; pin < 40; ++pin)
    if (fake_matrix.can_be_high(pin)) pins |= mask_of(pin);
  return pins;
}
/// The pins that were ever high.
inline PinMask once_high_pins() {
  PinMask pins = 0;
  for (const int pin : fake_matrix.ever_high) pins |= mask_of(pin);
  return pins;
}
/// Whether the motors get something: standby aside, a stage whose inputs that release it are low
/// does not drive.
inline bool drives(const BoardDescription& board) {
  return (high_pins() & release_pins(board)) != 0;
}

}  // namespace wheelwire::test
