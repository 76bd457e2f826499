// What the inputs of the power stages do while the motors are started, and when they drive.
#include "check.hpp"
#include "stage_boards.hpp"
#include "wired_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

/// Whether any of these pins was ever high.
bool was_high(PinMask pins) {
  for (const int pin : fake_matrix.ever_high)
    if (pins & mask_of(pin)) return true;
  return false;
}

}  // namespace

TEST(nothing_is_high_while_the_motors_start) {
  for (size_t i = 0; i < kStages; ++i) {
    fake_matrix = {};
    const BoardDescription board = board_of(static_cast<Stage>(i));
    WiredRobot robot(board);
    CHECK(robot.start(Parameters{}));
    CHECK(fake_matrix.pwm.runs);
    CHECK(!was_high(stage_pins(board)));
  }
}

TEST(only_the_wheel_that_is_to_drive_gets_a_duty) {
  for (size_t i = 0; i < kStages; ++i) {
    fake_matrix = {};
    const BoardDescription board = board_of(static_cast<Stage>(i));
    WiredRobot robot(board);
    CHECK(robot.start(Parameters{}));
    robot.left_motor.drive(1000);
    PinMask left = 0;
    PinMask right = 0;
    for (size_t input = 0; input < kStageInputs; ++input) {
      left |= mask_of(board.pin(input_of(0, input)));
      right |= mask_of(board.pin(input_of(1, input)));
    }
    CHECK(was_high(left) && !was_high(right));
    CHECK(board.standby < 0 || was_high(mask_of(board.standby)));
  }
}

TEST(nothing_is_driven_before_the_start) {
  fake_matrix = {};
  const BoardDescription board = board_of(Stage::kEnableIn1In2);
  WiredRobot robot(board);
  robot.left_motor.drive(1000);
  CHECK(fake_matrix.ever_high.empty());
}
