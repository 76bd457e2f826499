// Which pins the chip drives after a reset, with each board before and after it.
#include "pins.hpp"

#include <string.h>

#include "image_board.hpp"
#include "started_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

PinMask encoder_pins(const BoardDescription& board) {
  PinMask pins = 0;
  for (const BoardPin function : kEncoderPins) pins |= mask_of(board.pin(function));
  return pins;
}

/// The pins that the chip does not drive, but a peripheral would as soon as they were outputs.
PinMask lurking() {
  PinMask pins = 0;
  for (int pin = 0; pin < 40; ++pin) {
    const uint32_t route = fake_matrix.registers[output_route_register(pin)];
    if (!fake_matrix.enabled[pin] && route != 0 && route != SIG_GPIO_OUT_IDX) pins |= mask_of(pin);
  }
  return pins;
}

/// It drives both wheels.
struct DrivenRobot : StartedRobot {
  explicit DrivenRobot(const BoardDescription& of) : StartedRobot(of) {
    left_motor.drive(20'000);
    right_motor.drive(-20'000);
    CHECK(drives(of));
  }
};

}  // namespace

TEST(a_chip_without_a_confirmed_board_drives_no_pin) {
  for (const ConfigurationState state :
       {ConfigurationState::kDamaged, ConfigurationState::kBuiltIn}) {
    power_on();
    StartedRobot robot(kImageBoard, state);
    robot.left_motor.drive(20'000);
    robot.right_motor.brake();
    CHECK(driven_pins() == 0);
    release_motors();
    CHECK(driven_pins() == 0 && fake_matrix.ever_high.empty());
  }
}

TEST(a_board_on_trial_or_confirmed_drives_its_own_pins_alone_and_the_wheel_that_is_to_drive) {
  for (const ConfigurationState state : {ConfigurationState::kTrial, ConfigurationState::kStored}) {
    on_every_stage([state](const BoardDescription& board) {
      power_on();
      StartedRobot robot(board, state);
      CHECK(driven_pins() == stage_pins(board));
      CHECK((once_high_pins() & stage_pins(board)) == 0);
      CHECK(fake_matrix.pwm.runs);
      robot.left_motor.drive(1000);
      PinMask wheels[2] = {0, 0};
      for (size_t wheel = 0; wheel < 2; ++wheel)
        for (size_t input = 0; input < kStageInputs; ++input)
          wheels[wheel] |= mask_of(board.pin(input_of(wheel, input)));
      CHECK((once_high_pins() & wheels[0]) != 0 && (once_high_pins() & wheels[1]) == 0);
      CHECK(board.standby < 0 || (once_high_pins() & mask_of(board.standby)) != 0);
    });
  }
}

TEST(the_pins_of_the_previous_board_float_after_a_change) {
  on_every_stage([](const BoardDescription& former) {
    on_every_stage([&former](const BoardDescription& board) {
      power_on();
      DrivenRobot driver(former);
      StartedRobot robot(board, ConfigurationState::kTrial);
      CHECK(driven_pins() == stage_pins(board) && lurking() == 0);
      CHECK((driven_pins() & encoder_pins(board)) == 0);
    });
  });
}

TEST(the_image_s_board_after_a_confirmed_one_drives_nothing) {
  power_on();
  const BoardDescription former = board_of(Stage::kPwmIn1In2);
  DrivenRobot driver(former);
  StartedRobot robot(kImageBoard, ConfigurationState::kBuiltIn);
  CHECK(driven_pins() == 0 && lurking() == 0);
  // Again: nothing is left for the bootloader.
  bootloader_before_init();
  CHECK(driven_pins() == 0);
}

TEST(the_bootloader_holds_a_confirmed_board_low_and_nothing_of_one_on_trial) {
  for (const ConfigurationState state : {ConfigurationState::kTrial, ConfigurationState::kStored}) {
    on_every_stage([state](const BoardDescription& board) {
      power_on();
      StartedRobot robot(board, state);
      robot.left_motor.drive(20'000);
      bootloader_before_init();
      const PinMask held = state == ConfigurationState::kStored ? release_pins(board) : 0;
      CHECK(!drives(board) && driven_pins() == held);
      // What it holds, the application goes on holding until it knows the board.
      CHECK(float_pins());
      CHECK(driven_pins() == held);
    });
  }
}

TEST(the_bootloader_lets_all_pins_float_when_it_knows_no_board) {
  on_every_stage([](const BoardDescription& board) {
    for (const int content : {0x00, 0x5a, 0xff}) {
      power_on();
      DrivenRobot robot(board);
      memset(fake_rtc_memory.custom, content, sizeof fake_rtc_memory.custom);
      bootloader_before_init();
      CHECK(!drives(board) && (stage_pins(board) & driven_pins()) == 0);
    }
  });
}

TEST(a_saved_release_with_a_flipped_bit_is_not_believed) {
  power_on();
  const BoardDescription board = board_of(Stage::kHalfBridges);
  StartedRobot robot(board);
  CHECK(saved_release()->is_valid());
  for (size_t bit = 0; bit < 8 * sizeof(SavedRelease); ++bit) {
    uint8_t& byte = fake_rtc_memory.custom[bit / 8];
    const uint8_t good = byte;
    byte = static_cast<uint8_t>(good ^ 1 << bit % 8);
    CHECK(!saved_release()->is_valid() && saved_release_pins() == 0);
    byte = good;
  }
}

TEST(the_board_says_who_pulls_the_encoders_up) {
  for (const EncoderPulls pulls : {EncoderPulls::kInternal, EncoderPulls::kExternal}) {
    power_on();
    BoardDescription board = board_of(Stage::kEnableIn1In2);
    board.encoder_pulls = pulls;
    if (pulls == EncoderPulls::kExternal) board.left_encoder_a = 36;  // An input only.
    StartedRobot robot(board);
    for (const BoardPin function : kEncoderPins)
      CHECK(fake_matrix.pulled_up[board.pin(function)] == (pulls == EncoderPulls::kInternal));
  }
}

TEST(a_contact_is_open_when_two_samples_say_so) {
  BoardDescription board = board_of(Stage::kEnableIn1In2);
  for (const ContactKind kind : {ContactKind::kNormallyClosed, ContactKind::kNormallyOpen}) {
    board.estop_contact = kind;
    EstopContact contact;
    CHECK(contact.start(board));
    const int stop = kind == ContactKind::kNormallyClosed ? 1 : 0;
    fake_samples = {stop};
    CHECK(contact.is_open());
    fake_samples = {stop, 1 - stop};
    CHECK(!contact.is_open());
    fake_samples = {1 - stop};
    CHECK(!contact.is_open());
  }
  fake_samples = {0};
}
