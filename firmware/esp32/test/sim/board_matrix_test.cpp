// Every shipped board of the ESP32 as the firmware's active one, on every one that may be wired:
// what the windings do at the levels of each state in which nothing may drive.
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "check.hpp"
#include "power_stage.hpp"
#include "shipped_boards.hpp"
#include "wired_board.hpp"

using namespace wheelwire;
using namespace wheelwire::sim;

namespace {

/// What both windings do on one pair of boards while the firmware coasts, brakes, has released the
/// pins as a panic does, and has not touched them: o open, s shorted, F and R driven.
struct Pair {
  const char* active;
  const char* wired;
  const char* coast;
  const char* brake;
  const char* release;
  const char* floating;
};

// Worked out by hand from the parts' data sheets:
//   L298N      EN low: open. EN high: IN1 = IN2 shorts, IN1 high and IN2 low is forward.
//   TB6612FNG  STBY low, or IN1 = IN2 = low: open. Both high, or PWM low: shorted. It holds all of
//              its inputs low.
//   DRV8833    nSLEEP low, or both inputs low: open. Both high: shorted. It holds them low.
//   BTS7960    Enable low: open. Otherwise as an L298N.
//   MDD10A     PWM low: shorted. PWM high: DIR high is forward, low is reverse.
// All five boards have GPIO 25 and 33 as enable or PWM, 26 and 32 as IN1 or DIR, 27 and 4 as IN2,
// 21 as standby. 25 and 33 are pulled down where the part does not do it.
constexpr Pair kPairs[] = {
    // active    wired     coast brake release floating
    {"bts7960", "bts7960", "o", "s", "o", "o"},
    {"bts7960", "drv8833", "o", "o", "o", "o"},  // Asleep: nothing drives 21.
    {"bts7960", "l298n", "o", "s", "o", "o"},
    {"bts7960", "mdd10a", "s", "R", "s", "s"},   // Brake: enable high, IN1 low.
    {"bts7960", "tb6612", "o", "o", "o", "o"},   // In standby.
    {"drv8833", "bts7960", "o", "o", "o", "o"},  // The enables float, pulled down.
    {"drv8833", "drv8833", "o", "s", "o", "o"},
    {"drv8833", "l298n", "o", "o", "o", "o"},
    {"drv8833", "mdd10a", "s", "s", "s", "s"},
    {"drv8833", "tb6612", "o", "s", "o", "o"},
    {"l298n", "bts7960", "o", "s", "o", "o"},
    {"l298n", "drv8833", "o", "o", "o", "o"},
    {"l298n", "l298n", "o", "s", "o", "o"},
    {"l298n", "mdd10a", "s", "R", "s", "s"},
    {"l298n", "tb6612", "o", "o", "o", "o"},
    {"mdd10a", "bts7960", "o", "o", "o", "o"},  // It never makes PWM high without a duty.
    {"mdd10a", "drv8833", "o", "o", "o", "o"},
    {"mdd10a", "l298n", "o", "o", "o", "o"},
    {"mdd10a", "mdd10a", "s", "s", "s", "s"},
    {"mdd10a", "tb6612", "o", "o", "o", "o"},
    {"tb6612", "bts7960", "o", "o", "o", "o"},
    {"tb6612", "drv8833", "o", "s", "o", "o"},
    {"tb6612", "l298n", "o", "o", "o", "o"},
    {"tb6612", "mdd10a", "s", "s", "s", "s"},
    {"tb6612", "tb6612", "o", "s", "o", "o"},
};

const BoardDescription& board_named(const char* name) {
  for (const ShippedBoard& shipped : kShippedBoards)
    if (std::strcmp(shipped.name, name) == 0) return shipped.board;
  wheelwire::test::report(__FILE__, __LINE__, "a shipped board of this name");
  return kShippedBoards[0].board;
}

/// A chip with its active board, on a wired one.
struct WiredUp {
  WiredUp(const BoardDescription& active_board, const BoardDescription& wired_board,
          bool floating_level)
      : active(active_board), wired(wired_board) {
    wired.set_floating_level(floating_level);
    wired.read(pins);
  }

  void start() {
    left_stage.start(active, 0);
    right_stage.start(active, 1);
  }
  /// Two control periods: in the first one after a drive the stage coasts.
  void twice(auto act) {
    for (int i = 0; i < 2; ++i)
      for (PowerStage* motor : {&left, &right}) act(*motor);
  }
  /// As the panic handler, the dead-man and the bootloader do.
  void release() {
    for (int pin = 0; pin < 40; ++pin)
      if (release_pins(active) & mask_of(pin)) pins.drive(pin, 0);
    wired.read(pins);
  }

  /// What both windings do, as a letter; '?' where they differ, or where a PWM runs.
  char windings() const {
    const BridgeState& one = wired.bridges()[0].state();
    const BridgeState& other = wired.bridges()[1].state();
    if (one.on != other.on || one.duty != 1.0 || other.duty != 1.0) return '?';
    switch (one.on) {
      case Winding::kOpen:
        return 'o';
      case Winding::kShorted:
        return 's';
      case Winding::kForward:
        return 'F';
      case Winding::kReverse:
        return 'R';
    }
    return '?';
  }

  const BoardDescription& active;
  ChipPins pins;
  WiredBoard wired;
  DrivenStage left_stage{pins, wired};
  DrivenStage right_stage{pins, wired};
  PowerStage left{left_stage, *table_of(active.stage)};
  PowerStage right{right_stage, *table_of(active.stage)};
};

/// Each state as it is reached from a start, from either direction and from a brake, with either
/// level on inputs that nothing holds.
void for_each_way(const Pair& pair, auto check) {
  for (const bool floating_level : {false, true}) {
    for (const int duty : {0, 8'000, -8'000, 32'767, -32'767}) {
      WiredUp robot(board_named(pair.active), board_named(pair.wired), floating_level);
      robot.start();
      if (duty != 0)
        robot.twice([&](PowerStage& motor) { motor.drive(static_cast<int16_t>(duty)); });
      check(robot);
    }
  }
}

void expect(const Pair& pair, const char* state, const char* wanted, char seen) {
  if (*wanted == seen) return;
  std::printf("%s active, %s wired, %s: %c instead of %s\n", pair.active, pair.wired, state, seen,
              wanted);
  wheelwire::test::report(__FILE__, __LINE__, "the winding does what the table says");
}

/// Whether the stage drives at some levels of the inputs that nothing holds.
bool may_drive_afloat(Stage stage, uint8_t held_low) {
  const StageTable& table = *table_of(stage);
  for (unsigned levels = 0; levels < 1U << kStageInputs; ++levels) {
    StageOutputs inputs;
    for (size_t i = 0; i < kStageInputs; ++i) {
      const bool floats = (table.inputs & ~held_low) >> i & 1;
      inputs.duty_q15[i] = floats && (levels >> i & 1) ? kHigh_q15 : uint16_t{0};
    }
    if (state_of(stage, inputs).drives()) return true;
  }
  return false;
}

}  // namespace

TEST(matrix_has_every_pair_of_shipped_boards) {
  size_t row = 0;
  CHECK(sizeof kPairs / sizeof *kPairs == kShippedBoardsOfEsp32 * kShippedBoardsOfEsp32);
  for (size_t active = 0; active < kShippedBoardsOfEsp32; ++active) {
    for (size_t wired = 0; wired < kShippedBoardsOfEsp32; ++wired, ++row) {
      CHECK(std::string(kShippedBoards[active].name) == kPairs[row].active);
      CHECK(std::string(kShippedBoards[wired].name) == kPairs[row].wired);
      CHECK(kShippedBoards[active].board.chip == Chip::kEsp32);
    }
  }
}

TEST(matrix_coast_brake_and_release) {
  const auto coast = [](PowerStage& motor) { motor.coast(); };
  const auto brake = [](PowerStage& motor) { motor.brake(); };
  for (const Pair& pair : kPairs) {
    for_each_way(pair, [&](WiredUp& robot) {
      robot.twice(coast);
      expect(pair, "coast", pair.coast, robot.windings());
    });
    for_each_way(pair, [&](WiredUp& robot) {
      robot.twice(brake);
      expect(pair, "brake", pair.brake, robot.windings());
      robot.twice(coast);
      expect(pair, "coast after brake", pair.coast, robot.windings());
    });
    for_each_way(pair, [&](WiredUp& robot) {
      robot.release();
      expect(pair, "release", pair.release, robot.windings());
    });
    for_each_way(pair, [&](WiredUp& robot) {
      robot.twice(brake);
      robot.release();
      expect(pair, "release while braking", pair.release, robot.windings());
    });
  }
}

/// In reset, without a board, and on an unconfirmed board, no pin follows whatever the firmware's
/// motors do. A board on trial has started, and its motors are never asked for anything but to
/// coast.
TEST(matrix_floating_and_on_trial) {
  for (const Pair& pair : kPairs) {
    for (const bool floating_level : {false, true}) {
      WiredUp robot(board_named(pair.active), board_named(pair.wired), floating_level);
      expect(pair, "reset", pair.floating, robot.windings());
      robot.twice([](PowerStage& motor) { motor.drive(20'000); });
      robot.twice([](PowerStage& motor) { motor.brake(); });
      CHECK(robot.pins.driven() == 0);
      expect(pair, "floating", pair.floating, robot.windings());

      WiredUp on_trial(board_named(pair.active), board_named(pair.wired), floating_level);
      on_trial.start();
      expect(pair, "started", pair.release, on_trial.windings());
      on_trial.twice([](PowerStage& motor) { motor.coast(); });
      expect(pair, "trial", pair.coast, on_trial.windings());
    }
  }
}

/// Not a shipped board, but a common module: a DRV8833 that is never asleep. It follows a direction
/// that stays high when the enable or PWM falls, at full duty, and a release does not end that.
TEST(matrix_of_a_drv8833_that_is_never_asleep) {
  BoardDescription wired = board_named("drv8833");
  wired.standby = -1;
  const struct {
    const char* active;
    char coast;  // After forward.
    char brake;
    char release;  // While it drives forward.
  } kRows[] = {{"bts7960", 'o', 'o', 'o'},
               {"drv8833", 'o', 's', 'o'},
               {"l298n", 'F', 'o', 'F'},
               {"mdd10a", 'F', 'o', 'F'},
               {"tb6612", 'o', 's', 'o'}};
  for (const auto& row : kRows) {
    WiredUp robot(board_named(row.active), wired, true);
    CHECK(robot.windings() == 'o');
    robot.start();
    CHECK(robot.windings() == 'o');
    const auto forward = [](PowerStage& motor) { motor.drive(20'000); };
    robot.twice(forward);
    robot.twice([](PowerStage& motor) { motor.coast(); });
    CHECK(robot.windings() == row.coast);
    robot.twice([](PowerStage& motor) { motor.brake(); });
    CHECK(robot.windings() == row.brake);
    robot.twice(forward);
    robot.release();
    CHECK(robot.windings() == row.release);
  }
}

/// The pull-downs that a stage's table requires hold it off, whatever its other inputs pick up.
/// Without them it may drive.
TEST(matrix_pull_downs_are_needed_and_enough) {
  for (const Stage stage : {Stage::kEnableIn1In2, Stage::kHalfBridges, Stage::kPwmDir}) {
    CHECK(!may_drive_afloat(stage, table_of(stage)->pull_downs));
    CHECK(may_drive_afloat(stage, 0));
  }
  // These hold all inputs low by themselves.
  for (const Stage stage : {Stage::kPwmIn1In2, Stage::kInIn}) {
    CHECK(table_of(stage)->pull_downs == 0);
    CHECK(!may_drive_afloat(stage, table_of(stage)->inputs));
  }
}
