// The simulated board where it is not wired as the firmware's active one.
#include "board.hpp"

#include "check.hpp"
#include "shipped_boards.hpp"

using namespace wheelwire;
using namespace wheelwire::sim;

namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

struct Bench {
  explicit Bench(const BoardDescription& active_board = kBoardL298n) : active(active_board) {
    board.take_up(active);
  }

  /// Wired while it is off: the counters start with the levels that are there.
  void wire_and_start(const BoardDescription& wired) {
    board.reset();
    board.wire(wired);
    board.take_up(active);
  }

  /// Turns both wheels by hand, the left one forward and the right one twice as far back.
  EncoderCounts turned() {
    board.plant.turn_by_hand(kLeft, 0.5 * kTurn);
    board.plant.turn_by_hand(kRight, -1.0 * kTurn);
    board.run_until(board.now() + 2'000'000'000, true);
    return board.latch();
  }
  Winding left() const { return board.bridges()[kLeft].on; }

  BoardDescription active;
  SimulatedBoard board{1};
};

}  // namespace

TEST(board_counts_the_encoder_that_lies_on_its_pins) {
  using B = BoardDescription;
  const struct {
    void (*rewire)(B&);
    bool swapped;  ///< The encoders' own wires.
    int left, right;
  } cases[] = {
      {[](B&) {}, false, 180, -360},
      {[](B& b) { b.left_encoder_a = 16, b.left_encoder_b = 17; }, false, 0, -360},
      {[](B& b) { b.right_encoder_a = 16, b.right_encoder_b = 17; }, true, -360, 0},
      // Each has the other's, with A and B exchanged.
      {[](B& b) {
         std::swap(b.left_encoder_a, b.right_encoder_b);
         std::swap(b.left_encoder_b, b.right_encoder_a);
       },
       false, 360, -180},
  };
  Bench bench;
  for (const auto& one : cases) {
    BoardDescription wired = kBoardL298n;
    one.rewire(wired);
    bench.wire_and_start(wired);
    bench.board.wiring.swapped = one.swapped;
    const EncoderCounts counts = bench.turned();
    CHECK(counts.left == one.left && counts.right == one.right);
  }
}

TEST(board_sees_its_contact_on_its_own_pin_alone) {
  for (const bool same_pin : {true, false}) {
    for (const ContactKind kind : {ContactKind::kNormallyClosed, ContactKind::kNormallyOpen}) {
      BoardDescription active = kBoardL298n;
      active.estop_contact = kind;
      BoardDescription wired = active;
      if (!same_pin) wired.estop = 21;
      Bench bench(active);
      bench.board.wire(wired);
      for (const bool pressed : {false, true, false}) {
        bench.board.estop.open = pressed;
        // A pin with nothing but its pull-up is a broken wire.
        const bool wanted = same_pin ? pressed : kind == ContactKind::kNormallyClosed;
        CHECK(bench.board.estop.is_open() == wanted);
      }
    }
  }
}

TEST(board_with_another_kind_of_contact_stops_until_it_is_pressed) {
  Bench bench;
  BoardDescription wired = kBoardL298n;
  wired.estop_contact = ContactKind::kNormallyOpen;
  bench.board.wire(wired);
  CHECK(bench.board.estop.is_open());
  bench.board.estop.open = true;
  CHECK(!bench.board.estop.is_open());
}

TEST(board_without_a_contact_never_sees_one) {
  BoardDescription active = kBoardL298n;
  active.estop = -1;
  Bench bench(active);
  bench.board.wire(kBoardL298n);
  bench.board.estop.open = true;
  CHECK(!bench.board.estop.is_open());
}

TEST(board_measures_the_battery_on_its_pin_by_its_divider) {
  BoardDescription active = kBoardL298n;
  active.battery = 34;
  Bench bench(active);
  bench.board.battery.volts = 8.0;
  CHECK(bench.board.battery.millivolts() == 8000);
  BoardDescription wired = active;
  wired.battery_divider_permille = 8000;
  bench.board.wire(wired);
  CHECK(bench.board.battery.millivolts() == 4000);
  wired.battery = 35;
  bench.board.wire(wired);
  CHECK(bench.board.battery.millivolts() == 0);
  bench.board.wire_as_active();
  CHECK(bench.board.battery.millivolts() == 8000);
}

TEST(board_counts_pins_that_both_sides_drive) {
  Bench bench;
  CHECK(bench.board.pin_conflicts() == 0);
  BoardDescription wired = kBoardL298n;
  wired.left_encoder_a = kBoardL298n.left_in2;
  wired.right_encoder_b = kBoardL298n.led;
  wired.estop = kBoardL298n.right_enable;
  bench.board.wire(wired);
  CHECK(bench.board.pin_conflicts() == 3);
  bench.board.estop.open = true;
  CHECK(bench.board.pin_conflicts() == 2);
  bench.board.reset();  // Every pin floats.
  CHECK(bench.board.pin_conflicts() == 0);
  bench.board.take_up(kBoardL298n, false);
  CHECK(bench.board.pin_conflicts() == 0);
  for (const ShippedBoard& shipped : kShippedBoards) {
    if (shipped.board.chip != Chip::kEsp32) continue;
    bench.board.reset();
    bench.board.wire(shipped.board);
    bench.board.take_up(kBoardL298n);
    CHECK(bench.board.pin_conflicts() == 0);
  }
}

TEST(board_drives_nothing_that_was_not_confirmed) {
  for (const ShippedBoard& shipped : kShippedBoards) {
    Bench bench(shipped.board);
    bench.board.reset();
    bench.board.take_up(shipped.board, false);
    const Winding afloat = bench.left();
    CHECK(afloat == (shipped.board.stage == Stage::kPwmDir ? Winding::kShorted : Winding::kOpen));
    for (int i = 0; i < 3; ++i) {
      bench.board.hal().left_motor.drive(20'000);
      bench.board.hal().right_motor.brake();
      CHECK(bench.board.pins().driven() == 0);
      CHECK(!bench.board.drives() && bench.left() == afloat);
    }
    // It counts and reads, as it does when it drives.
    CHECK(bench.turned().left == 180);
    bench.board.estop.open = true;
    CHECK(bench.board.estop.is_open() == (shipped.board.estop >= 0));
  }
}

TEST(board_that_has_none_drives_and_counts_nothing) {
  Bench bench;
  bench.board.reset();
  bench.board.take_up(BoardDescription{}, true);
  bench.board.hal().left_motor.drive(20'000);
  CHECK(bench.board.pins().driven() == 0 && !bench.board.drives());
  // What was wired stays.
  CHECK(bench.board.wired() == kBoardL298n && bench.left() == Winding::kOpen);
  const EncoderCounts counts = bench.turned();
  CHECK(counts.left == 0 && counts.right == 0);
  CHECK(!bench.board.estop.is_open());
}

TEST(board_floats_in_reset_whatever_it_did) {
  for (const ShippedBoard& shipped : kShippedBoards) {
    Bench bench(shipped.board);
    const Winding wanted =
        shipped.board.stage == Stage::kPwmDir ? Winding::kShorted : Winding::kOpen;
    for (int i = 0; i < 2; ++i) {
      bench.board.hal().left_motor.drive(20'000);
      bench.board.hal().left_motor.drive(20'000);
      CHECK(bench.board.drives());
      bench.board.reset();
      CHECK(bench.left() == wanted && bench.board.pins().driven() == 0);
      bench.board.take_up(shipped.board);
      CHECK(!bench.board.drives());
    }
  }
}

TEST(board_is_rewired_at_once) {
  Bench bench;
  bench.board.hal().left_motor.brake();
  CHECK(bench.left() == Winding::kShorted);
  for (int i = 0; i < 2; ++i) {
    bench.board.wire(kBoardMdd10a);
    CHECK(bench.left() == Winding::kReverse && bench.board.drives());
  }
  bench.board.wire_as_active();
  CHECK(bench.left() == Winding::kShorted && !bench.board.drives());
  bench.board.wire(kBoardMdd10a);
  bench.board.reset();
  bench.board.take_up(kBoardTb6612);  // Which does not change the wires.
  CHECK(bench.board.wired() == kBoardMdd10a);
}

/// An input of the chip pulls weakly: it wins against a part's own pull-down, not against 10 kOhm.
TEST(board_pull_up_of_an_input_decides_what_only_the_part_holds) {
  for (const bool has_pull_down : {false, true}) {
    BoardDescription wired = kBoardTb6612;
    wired.left_in1 = kBoardTb6612.estop;
    wired.estop = -1;
    if (has_pull_down) wired.pulldowns = mask_of(wired.left_in1);
    Bench bench(kBoardTb6612);
    bench.board.wire(wired);
    bench.board.hal().left_motor.coast();  // Standby is high.
    CHECK(bench.left() == (has_pull_down ? Winding::kOpen : Winding::kShorted));
  }
}

TEST(board_in_standby_is_open_until_the_first_step) {
  Bench bench(kBoardTb6612);
  CHECK(bench.board.pins().is_driven(kBoardTb6612.standby));
  CHECK(bench.board.pins().duty_q15(kBoardTb6612.standby) == 0);
  bench.board.hal().left_motor.brake();
  CHECK(bench.board.pins().duty_q15(kBoardTb6612.standby) == kHigh_q15);
  CHECK(bench.left() == Winding::kShorted);
  // Tied high on the module instead.
  BoardDescription wired = kBoardTb6612;
  wired.standby = -1;
  Bench tied(kBoardTb6612);
  tied.board.wire(wired);
  tied.board.hal().left_motor.brake();
  CHECK(tied.left() == Winding::kShorted);
}
