// What the inputs of the power stages do while the motors are started, and when they drive.
#include "check.hpp"
#include "stage_boards.hpp"
#include "wired_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

TEST(nothing_is_high_while_the_motors_start_and_then_the_wheel_that_is_to_drive_alone) {
  on_every_stage([](const BoardDescription& board) {
    fake_matrix = {};
    WiredRobot robot(board);
    CHECK(robot.start(Parameters{}));
    CHECK(fake_matrix.pwm.runs);
    CHECK((once_high_pins() & stage_pins(board)) == 0);
    robot.left_motor.drive(1000);
    PinMask wheels[2] = {0, 0};
    for (size_t wheel = 0; wheel < 2; ++wheel)
      for (size_t input = 0; input < kStageInputs; ++input)
        wheels[wheel] |= mask_of(board.pin(input_of(wheel, input)));
    CHECK((once_high_pins() & wheels[0]) != 0 && (once_high_pins() & wheels[1]) == 0);
    CHECK(board.standby < 0 || (once_high_pins() & mask_of(board.standby)) != 0);
  });
}
