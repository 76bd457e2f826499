#include "board_rules.hpp"

#include <iterator>
#include <vector>

#include "check.hpp"

using namespace wheelwire;

namespace {

constexpr BoardDescription good() {
  BoardDescription board;
  board.version = kBoardVersion;
  board.chip = Chip::kEsp32;
  board.name[0] = 'x';
  board.left_enable = 25;
  board.left_in1 = 26;
  board.left_in2 = 27;
  board.left_encoder_a = 18;
  board.left_encoder_b = 19;
  board.right_enable = 33;
  board.right_in1 = 32;
  board.right_in2 = 4;
  board.right_encoder_a = 23;
  board.right_encoder_b = 13;
  board.estop = 14;
  board.pwm_frequency_hz = 20'000;
  board.encoder_filter_ns = 1000;
  board.pulldowns = mask_of(25) | mask_of(33);
  return board;
}

static_assert(first_issue(good()).fault == BoardFault::kNone);

std::vector<BoardIssue> issues(auto change) {
  BoardDescription board = good();
  change(board);
  std::vector<BoardIssue> found;
  check_board(board, [&found](const BoardIssue& issue) { found.push_back(issue); });
  return found;
}

/// Whether a change of a good board has this one fault and no other.
bool only(BoardFault fault, auto change) {
  const std::vector<BoardIssue> found = issues(change);
  return found.size() == 1 && found[0].fault == fault;
}

}  // namespace

TEST(board_of_a_named_module_has_the_pins_that_this_one_leaves_free) {
  CHECK(only(BoardFault::kPinOfMemory, [](auto& b) { b.left_encoder_a = 16; }));
  for (const int8_t pin : {int8_t{16}, int8_t{17}}) {
    const auto with = [pin](Module module) {
      return [pin, module](BoardDescription& b) {
        b.left_encoder_a = pin;
        b.module = module;
      };
    };
    CHECK(issues(with(Module::kWroom32)).empty());
    CHECK(only(BoardFault::kPinOfMemory, with(Module::kWrover)));
  }
}

TEST(board_with_an_led_on_a_strap_can_be_used) {
  CHECK(only(BoardFault::kLedOnStrap, [](auto& b) { b.led = 2; }));
  BoardDescription board = good();
  board.led = 2;
  CHECK(first_issue(board).fault == BoardFault::kNone);
}

TEST(board_faults_are_found_one_by_one) {
  using B = BoardDescription;
  CHECK(only(BoardFault::kModule, [](B& b) { b.module = Module::kS3Quad; }));
  CHECK(only(BoardFault::kModule, [](B& b) { b.module = static_cast<Module>(99); }));
  CHECK(only(BoardFault::kVersion, [](B& b) { b.version = 2; }));
  CHECK(only(BoardFault::kChip, [](B& b) { b.chip = Chip::kSimulated; }));
  CHECK(only(BoardFault::kStage, [](B& b) { b.stage = static_cast<Stage>(9); }));
  CHECK(only(BoardFault::kName, [](B& b) { b.name[0] = '\0'; }));
  CHECK(only(BoardFault::kName, [](B& b) { b.name[1] = '\n'; }));
  CHECK(only(BoardFault::kName, [](B& b) { b.name[2] = 'x'; }));
  CHECK(only(BoardFault::kCode, [](B& b) { b.encoder_pulls = static_cast<EncoderPulls>(7); }));
  CHECK(only(BoardFault::kLine, [](B& b) { b.line = BoardLine::kUsb; }));
  CHECK(only(BoardFault::kPinMissing, [](B& b) { b.left_in2 = -1; }));
  CHECK(only(BoardFault::kPinMissing, [](B& b) { b.right_encoder_b = -1; }));
  CHECK(only(BoardFault::kPinWithoutUse, [](B& b) { b.left_dir = 21; }));
  CHECK(only(BoardFault::kPinWithoutUse, [](B& b) { b.standby = 21; }));
  CHECK(only(BoardFault::kPinAbsent, [](B& b) { b.left_in1 = 20; }));
  CHECK(only(BoardFault::kPinAbsent, [](B& b) { b.left_in1 = 99; }));
  CHECK(only(BoardFault::kPinAbsent, [](B& b) { b.led = -7; }));
  CHECK(only(BoardFault::kPinOfMemory, [](B& b) { b.left_in1 = 6; }));
  CHECK(only(BoardFault::kPinOfMemory, [](B& b) { b.left_in1 = 17; }));
  CHECK(only(BoardFault::kPinOfLink, [](B& b) { b.left_in1 = 3; }));
  CHECK(only(BoardFault::kPinStrapping, [](B& b) { b.left_in1 = 12; }));
  CHECK(only(BoardFault::kPinInputOnly, [](B& b) { b.left_in1 = 35; }));
  CHECK(only(BoardFault::kPinTwice, [](B& b) { b.left_in1 = 27; }));
  CHECK(only(BoardFault::kNoPullUp, [](B& b) { b.left_encoder_a = 36; }));
  CHECK(only(BoardFault::kNoPullUpForContact, [](B& b) { b.estop = 39; }));
  CHECK(only(BoardFault::kNoPullDown, [](B& b) { b.pulldowns = mask_of(25); }));
  CHECK(only(BoardFault::kPullDownWithoutUse, [](B& b) { b.pulldowns |= mask_of(18); }));
  CHECK(only(BoardFault::kPinPulledUp, [](B& b) {
    b.stage = Stage::kHalfBridges;
    b.left_in1 = 14;
    b.estop = 26;
  }));
  CHECK(only(BoardFault::kPinHeldHigh, [](B& b) {
    b.chip = Chip::kLinux;
    b.left_enable = 2;
    b.right_enable = 12;
    b.right_in1 = 11;
    b.pulldowns = mask_of(2) | mask_of(12);
  }));
  CHECK(only(BoardFault::kFrequencyHigh, [](B& b) { b.pwm_frequency_hz = 40'001; }));
  CHECK(only(BoardFault::kFrequencyLow, [](B& b) { b.pwm_frequency_hz = 99; }));
  CHECK(only(BoardFault::kFilter, [](B& b) { b.encoder_filter_ns = 12'788; }));
  CHECK(only(BoardFault::kNoAdc, [](B& b) {
    b.battery = 21;
    b.battery_divider_permille = 4000;
  }));
  CHECK(only(BoardFault::kDivider, [](B& b) { b.battery = 34; }));
}

TEST(board_inputs_that_release_a_stage_are_low_while_the_chip_starts) {
  using B = BoardDescription;
  // An enable on a pulled-up pin: its pull-down is missing for two reasons, and named once.
  const auto enable_on_14 = [](B& b) {
    b.left_enable = 14;
    b.estop = 25;
    b.pulldowns = mask_of(33);
  };
  CHECK(only(BoardFault::kNoPullDown, enable_on_14));
  CHECK(issues([&](B& b) {
          enable_on_14(b);
          b.pulldowns |= mask_of(14);
        }).empty());
  // A direction of the L298N is not asked, a contact even less so.
  CHECK(issues([](B& b) {
          b.left_in1 = 14;
          b.estop = 26;
        }).empty());
  // Pins that are refused for another reason are refused once.
  CHECK(only(BoardFault::kPinStrapping, [](B& b) {
    b.stage = Stage::kHalfBridges;
    b.left_in1 = 15;
  }));
  CHECK(only(BoardFault::kPinOfLink, [](B& b) {
    b.stage = Stage::kHalfBridges;
    b.left_in1 = 1;
  }));
}

TEST(board_pin_twice_names_both_uses) {
  const auto found = issues([](BoardDescription& b) { b.estop = 27; });
  CHECK(found.size() == 1 && found[0].function == BoardPin::kEstop && found[0].pin == 27 &&
        found[0].other == BoardPin::kLeftIn2);
}

TEST(board_external_pull_ups_allow_input_only_pins) {
  CHECK(issues([](BoardDescription& b) {
          b.left_encoder_a = 36;
          b.encoder_pulls = EncoderPulls::kExternal;
        }).empty());
}

TEST(board_resources_are_counted) {
  // No chip of today has too few; one that had would be refused.
  ChipTable chip = *table_of(Chip::kEsp32);
  chip.counters = 1;
  chip.pwm_outputs = 1;
  const BoardDescription board = good();
  std::vector<BoardFault> found;
  auto report = [&found](const BoardIssue& issue) { found.push_back(issue.fault); };
  BoardCheck(board, chip, kStageTables[0], report).run();
  CHECK((found == std::vector{BoardFault::kCounters, BoardFault::kPwmOutputs}));
}

/// By hand: the inputs that let a motor coast when they are low; the others of a stage only choose
/// a direction.
TEST(the_pins_to_release_are_standby_and_those_of_both_wheels_that_coast) {
  BoardDescription board = good();
  board.left_pwm = 2;
  board.left_dir = 5;
  board.right_pwm = 12;
  board.right_dir = 15;
  const PinMask enables = mask_of(25) | mask_of(33);
  const PinMask ins = mask_of(26) | mask_of(27) | mask_of(32) | mask_of(4);
  const PinMask pwms = mask_of(2) | mask_of(12);
  const struct {
    Stage stage;
    PinMask pins;
  } rows[] = {
      {Stage::kEnableIn1In2, enables},      {Stage::kPwmIn1In2, ins | pwms}, {Stage::kInIn, ins},
      {Stage::kHalfBridges, enables | ins}, {Stage::kPwmDir, pwms},
  };
  static_assert(std::size(rows) == kStages);
  for (const auto& row : rows) {
    board.stage = row.stage;
    board.standby = -1;
    CHECK(release_pins(board) == row.pins);
    board.standby = 22;
    CHECK(release_pins(board) == (row.pins | mask_of(22)));
  }
}
