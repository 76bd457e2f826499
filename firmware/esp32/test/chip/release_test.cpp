// What a panic, the dead-man and the bootloader do with the pins of any power stage.
#include <string.h>

#include "check.hpp"
#include "pins.hpp"
#include "release_pins.hpp"
#include "stage_boards.hpp"
#include "wired_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

extern "C" void bootloader_before_init();

namespace {

/// A robot that drives both wheels.
struct Driving {
  explicit Driving(const BoardDescription& of) : board(of) {
    fake_matrix = {};
    CHECK(take_pins(ConfigurationState::kStored, board));
    CHECK(robot.start(Parameters{}));
    robot.left_motor.drive(20'000);
    robot.right_motor.drive(-20'000);
    CHECK(drives(board));
  }

  BoardDescription board;
  WiredRobot robot{board};
};

}  // namespace

TEST(a_release_takes_the_drive_from_every_stage) {
  on_every_stage([](const BoardDescription& board) {
    Driving driving(board);
    release_motors();
    CHECK(!drives(board));
    // Until a control step drives again.
    driving.robot.left_motor.drive(20'000);
    CHECK(drives(board));
  });
}

TEST(the_bootloader_lets_all_pins_float_when_it_knows_no_board) {
  on_every_stage([](const BoardDescription& board) {
    for (const int content : {0x00, 0x5a, 0xff}) {
      Driving driving(board);
      memset(fake_rtc_memory.custom, content, sizeof fake_rtc_memory.custom);
      bootloader_before_init();
      CHECK(!drives(board) && (stage_pins(board) & driven_pins()) == 0);
    }
  });
}

TEST(a_saved_release_with_a_flipped_bit_is_not_believed) {
  Driving driving(board_of(Stage::kHalfBridges));
  CHECK(saved_release()->is_valid());
  for (size_t bit = 0; bit < 8 * sizeof(SavedRelease); ++bit) {
    fake_rtc_memory.custom[bit / 8] =
        static_cast<uint8_t>(fake_rtc_memory.custom[bit / 8] ^ 1 << bit % 8);
    CHECK(!saved_release()->is_valid() && saved_release_pins() == 0);
    fake_rtc_memory.custom[bit / 8] =
        static_cast<uint8_t>(fake_rtc_memory.custom[bit / 8] ^ 1 << bit % 8);
  }
}
