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
  explicit Driving(Stage stage) : board(board_of(stage)) {
    fake_matrix = {};
    CHECK(take_pins(ConfigurationState::kStored, board));
    CHECK(robot.start(Parameters{}));
    robot.left_motor.drive(20'000);
    robot.right_motor.drive(-20'000);
  }

  /// Whether the motors get something: standby aside, a stage whose inputs that release it are low
  /// does not drive.
  bool drives() const {
    for (int pin = 0; pin < 40; ++pin)
      if (release_pins(board) & mask_of(pin) && fake_matrix.can_be_high(pin)) return true;
    return false;
  }

  BoardDescription board;
  WiredRobot robot{board};
};

}  // namespace

TEST(a_release_takes_the_drive_from_every_stage) {
  for (size_t i = 0; i < kStages; ++i) {
    Driving driving(static_cast<Stage>(i));
    CHECK(driving.drives());
    release_motors();
    CHECK(!driving.drives());
    // Until a control step drives again.
    driving.robot.left_motor.drive(20'000);
    CHECK(driving.drives());
  }
}

TEST(the_bootloader_releases_the_board_that_was_active) {
  for (size_t i = 0; i < kStages; ++i) {
    Driving driving(static_cast<Stage>(i));
    bootloader_before_init();
    CHECK(!driving.drives());
    // Low by the chip, not floating.
    for (int pin = 0; pin < 40; ++pin)
      CHECK(!(release_pins(driving.board) & mask_of(pin)) || fake_matrix.enabled[pin]);
  }
}

TEST(the_bootloader_lets_all_pins_float_when_it_knows_no_board) {
  for (size_t i = 0; i < kStages; ++i) {
    for (const int content : {0x00, 0x5a, 0xff}) {
      Driving driving(static_cast<Stage>(i));
      memset(fake_rtc_memory.custom, content, sizeof fake_rtc_memory.custom);
      bootloader_before_init();
      CHECK(!driving.drives());
      for (int pin = 0; pin < 40; ++pin)
        CHECK(!(stage_pins(driving.board) & mask_of(pin)) || !fake_matrix.enabled[pin]);
    }
  }
}

TEST(a_saved_release_with_a_flipped_bit_is_not_believed) {
  Driving driving(Stage::kHalfBridges);
  CHECK(saved_release()->is_valid());
  for (size_t bit = 0; bit < 8 * sizeof(SavedRelease); ++bit) {
    fake_rtc_memory.custom[bit / 8] =
        static_cast<uint8_t>(fake_rtc_memory.custom[bit / 8] ^ 1 << bit % 8);
    CHECK(!saved_release()->is_valid() && saved_release_pins() == 0);
    fake_rtc_memory.custom[bit / 8] =
        static_cast<uint8_t>(fake_rtc_memory.custom[bit / 8] ^ 1 << bit % 8);
  }
}
