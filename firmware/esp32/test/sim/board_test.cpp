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
  using enum ContactKind;
  const struct {
    int8_t active_pin;
    ContactKind active;
    int8_t wired_pin;
    ContactKind wired;
    bool pressed, released;  ///< Whether it is then open.
  } cases[] = {
      {14, kNormallyClosed, 14, kNormallyClosed, true, false},
      {14, kNormallyOpen, 14, kNormallyOpen, true, false},
      // A pin with nothing but its pull-up is a broken wire.
      {14, kNormallyClosed, 21, kNormallyClosed, true, true},
      {14, kNormallyOpen, 21, kNormallyOpen, false, false},
      {14, kNormallyClosed, 14, kNormallyOpen, false, true},
      {-1, kNormallyClosed, 14, kNormallyClosed, false, false},
  };
  for (const auto& one : cases) {
    BoardDescription active = kBoardL298n;
    active.estop = one.active_pin;
    active.estop_contact = one.active;
    BoardDescription wired = kBoardL298n;
    wired.estop = one.wired_pin;
    wired.estop_contact = one.wired;
    Bench bench(active);
    bench.board.wire(wired);
    for (const bool pressed : {false, true, false}) {
      bench.board.estop.open = pressed;
      CHECK(bench.board.estop.is_open() == (pressed ? one.pressed : one.released));
    }
  }
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
