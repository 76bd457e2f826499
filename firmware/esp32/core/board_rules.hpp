// The rules that a board must obey: the only check, at compile time for an image's own board, on
// the chip for one that is written to it, and on a computer through the C interface.
#pragma once

#include "board_tables.hpp"

namespace wheelwire {

/// What is wrong with a board: the values for the sentence of `fault`.
struct BoardIssue {
  BoardFault fault = BoardFault::kNone;
  BoardPin function = BoardPin::kLed;  ///< What the pin is used for.
  int pin = -1;                        ///< GPIO; -1: the fault does not concern a pin.
  BoardPin other = BoardPin::kLed;     ///< Its other use.
  uint32_t value = 0;
  uint32_t limit = 0;
};

constexpr PinMask mask_of(int pin) { return pin >= 0 && pin < 64 ? PinMask{1} << pin : 0; }

/// The inputs of a power stage begin here in a board's pins, for each wheel.
constexpr BoardPin kWheelPins[2] = {BoardPin::kLeftEnable, BoardPin::kRightEnable};
constexpr BoardPin kEncoderPins[4] = {BoardPin::kLeftEncoderA, BoardPin::kLeftEncoderB,
                                      BoardPin::kRightEncoderA, BoardPin::kRightEncoderB};

constexpr BoardPin input_of(size_t wheel, size_t input) {
  return static_cast<BoardPin>(static_cast<size_t>(kWheelPins[wheel]) + input);
}

/// The row of a table that is about this chip; nullptr if there is none.
template <typename Row, size_t kCount, typename Code>
constexpr const Row* row_of(const Row (&table)[kCount], Code chip) {
  for (const Row& row : table)
    if (row.chip == chip) return &row;
  return nullptr;
}

/// nullptr if it is unknown.
constexpr const ChipTable* table_of(Chip chip) { return row_of(kChipTables, chip); }

/// nullptr if it is unknown.
constexpr const StageTable* table_of(Stage stage) {
  return static_cast<size_t>(stage) < kStages ? &kStageTables[static_cast<size_t>(stage)] : nullptr;
}

/// Whether the stage coasts while this input is low.
constexpr bool is_released_by_low(const StageTable& stage, size_t input) {
  return stage.rows[static_cast<size_t>(StageAction::kCoast)][input] == StageLevel::kLow;
}

/// The GPIOs of standby and of those inputs of the power stages.
template <typename IsMeant>
constexpr PinMask stage_pins(const BoardDescription& board, IsMeant is_meant) {
  PinMask pins = mask_of(board.standby);
  for (size_t wheel = 0; wheel < 2; ++wheel)
    for (size_t input = 0; input < kStageInputs; ++input)
      if (is_meant(input)) pins |= mask_of(board.pin(input_of(wheel, input)));
  return pins;
}

/// The GPIOs that the board drives as inputs of its power stages, standby included.
constexpr PinMask stage_pins(const BoardDescription& board) {
  return stage_pins(board, [](size_t) { return true; });
}

/// The pins that, when low, hold both motors off, whatever the others do. On every stage these are
/// the inputs that are low while it coasts, and standby.
constexpr PinMask release_pins(const BoardDescription& board) {
  const StageTable* const stage = table_of(board.stage);
  return stage_pins(board, [stage](size_t input) {
    return stage != nullptr && is_released_by_low(*stage, input);
  });
}

/// nullptr if it is unknown, or not named.
constexpr const ModuleTable* table_of(Module module) {
  for (const ModuleTable& table : kModuleTables)
    if (table.module == module) return &table;
  return nullptr;
}

/// The GPIOs of flash and PSRAM on the board's module, or on any module if it names none.
constexpr PinMask memory_pins(const ChipTable& chip, Module module) {
  const ModuleTable* table = table_of(module);
  return table != nullptr && table->chip == chip.chip ? table->memory : chip.memory;
}

/// Why a pin is not free on this chip, for any use, as a BoardFault or a PeripheralFault.
template <typename Fault>
constexpr Fault fault_of_place(const ChipTable& chip, PinMask memory, int pin) {
  const PinMask mask = mask_of(pin);
  if (!(chip.existing & mask)) return Fault::kPinAbsent;
  if (memory & mask) return Fault::kPinOfMemory;
  if ((chip.uart | chip.usb) & mask) return Fault::kPinOfLink;
  return chip.strapping & mask ? Fault::kPinStrapping : Fault::kNone;
}

/// The GPIOs that some board on this module may drive.
constexpr PinMask drivable_pins(const ChipTable& chip, Module module = Module::kAny) {
  return chip.existing &
         ~(memory_pins(chip, module) | chip.uart | chip.usb | chip.strapping | chip.input_only);
}

/// Checks one board against the tables; `report` is called with each BoardIssue.
template <typename Report>
class BoardCheck {
 public:
  constexpr BoardCheck(const BoardDescription& board, const ChipTable& chip,
                       const StageTable& stage, Report& report)
      : board_(board),
        chip_(chip),
        stage_(stage),
        memory_(memory_pins(chip, board.module)),
        drivable_(drivable_pins(chip, board.module)),
        report_(report) {}

  constexpr void run() {
    check_name();
    check_codes();
    for (size_t wheel = 0; wheel < 2; ++wheel) check_stage(wheel);
    check_standby();
    check_encoders();
    check_estop();
    check_battery();
    check_led();
    check_pull_downs();
    check_resources();
    for (size_t i = 0; i < kBoardPinCount; ++i) check_place(static_cast<BoardPin>(i));
  }

 private:
  constexpr void tell(BoardFault fault, uint32_t value = 0, uint32_t limit = 0) {
    report_(BoardIssue{.fault = fault, .value = value, .limit = limit});
  }
  constexpr void tell(BoardFault fault, BoardPin function) {
    report_(BoardIssue{.fault = fault, .function = function, .pin = board_.pin(function)});
  }

  constexpr void check_name() {
    bool ended = false;
    bool printable = board_.name[0] != '\0';
    for (const char letter : board_.name) {
      if (letter == '\0') ended = true;
      const bool fits = ended ? letter == '\0' : letter >= ' ' && letter <= '~';
      printable = printable && fits;
    }
    if (!printable) tell(BoardFault::kName);
  }

  constexpr void check_codes() {
    if (board_.encoder_pulls > EncoderPulls::kExternal ||
        board_.estop_contact > ContactKind::kNormallyOpen || board_.line > BoardLine::kUsb)
      tell(BoardFault::kCode);
    if (board_.line == BoardLine::kUsb && chip_.usb == 0) tell(BoardFault::kLine);
    const ModuleTable* module = table_of(board_.module);
    if (board_.module != Module::kAny && (module == nullptr || module->chip != chip_.chip))
      tell(BoardFault::kModule);
  }

  constexpr void check_stage(size_t wheel) {
    for (size_t input = 0; input < kStageInputs; ++input) {
      const BoardPin function = input_of(wheel, input);
      const int pin = board_.pin(function);
      const bool wanted = (stage_.inputs >> input & 1) != 0;
      if (wanted && pin < 0) tell(BoardFault::kPinMissing, function);
      if (!wanted && pin >= 0) tell(BoardFault::kPinWithoutUse, function);
      if (!wanted || pin < 0) continue;
      check_drives(function);
      if (is_released_by_low(stage_, input))
        check_low_at_reset(function, (stage_.pull_downs >> input & 1) != 0);
    }
  }

  constexpr void check_standby() {
    if (board_.standby < 0) return;
    if (!stage_.has_standby) return tell(BoardFault::kPinWithoutUse, BoardPin::kStandby);
    check_drives(BoardPin::kStandby);
    check_low_at_reset(BoardPin::kStandby, false);
  }

  /// While the chip starts, only resistors keep an input low that holds the motors off. The stage's
  /// own, if it has one, wins over nothing: 100 kOhm and more. An input that may be high while the
  /// stage is released, such as a direction, is not looked at.
  constexpr void check_low_at_reset(BoardPin function, bool floats) {
    const PinMask pin = mask_of(board_.pin(function));
    const bool is_pulled_down = (board_.pulldowns & pin) != 0;
    if (chip_.held_high & drivable_ & pin) {
      tell(BoardFault::kPinHeldHigh, function);
    } else if (floats && !is_pulled_down) {
      tell(BoardFault::kNoPullDown, function);
    } else if ((chip_.pulled_up & drivable_ & pin) && !is_pulled_down) {
      tell(BoardFault::kPinPulledUp, function);
    }
  }

  constexpr void check_drives(BoardPin function) {
    if (chip_.input_only & mask_of(board_.pin(function))) tell(BoardFault::kPinInputOnly, function);
  }

  /// Without a pull-up an input floats while the encoder's open collector is off or its wire is
  /// broken: it picks up noise and counts ticks of a wheel that is at rest.
  constexpr void check_encoders() {
    for (const BoardPin function : kEncoderPins) {
      const int pin = board_.pin(function);
      if (pin < 0) tell(BoardFault::kPinMissing, function);
      if (board_.encoder_pulls == EncoderPulls::kInternal && (chip_.input_only & mask_of(pin)))
        tell(BoardFault::kNoPullUp, function);
    }
    if (board_.encoder_filter_ns > kMaxFilterNs)
      tell(BoardFault::kFilter, board_.encoder_filter_ns, kMaxFilterNs);
  }

  constexpr void check_estop() {
    if (chip_.input_only & mask_of(board_.estop))
      tell(BoardFault::kNoPullUpForContact, BoardPin::kEstop);
  }

  constexpr void check_battery() {
    if (board_.battery < 0) return;
    if (chip_.adc == 0) {
      tell(BoardFault::kNotOnThisChip, BoardPin::kBattery);
    } else if (!(chip_.adc & mask_of(board_.battery))) {
      tell(BoardFault::kNoAdc, BoardPin::kBattery);
    }
    if (board_.battery_divider_permille < 1000 || board_.battery_divider_permille > 20'000)
      tell(BoardFault::kDivider, board_.battery_divider_permille);
  }

  constexpr void check_led() {
    if (board_.led >= 0 && !chip_.has_led) return tell(BoardFault::kNotOnThisChip, BoardPin::kLed);
    check_drives(BoardPin::kLed);
  }

  constexpr void check_pull_downs() {
    const PinMask unused = board_.pulldowns & ~stage_pins(board_);
    for (int pin = 0; pin < 64; ++pin)
      if (unused & mask_of(pin))
        report_(BoardIssue{.fault = BoardFault::kPullDownWithoutUse, .pin = pin});
  }

  constexpr void check_resources() {
    constexpr uint32_t kWheels = 2;
    if (board_.pwm_frequency_hz > stage_.max_frequency_hz)
      tell(BoardFault::kFrequencyHigh, board_.pwm_frequency_hz, stage_.max_frequency_hz);
    if (board_.pwm_frequency_hz < kMinPwmFrequencyHz)
      tell(BoardFault::kFrequencyLow, board_.pwm_frequency_hz, kMinPwmFrequencyHz);
    if (kWheels > chip_.counters) tell(BoardFault::kCounters, kWheels, chip_.counters);
    const uint32_t outputs = kWheels * stage_.pwm_outputs;
    if (outputs > chip_.pwm_outputs) tell(BoardFault::kPwmOutputs, outputs, chip_.pwm_outputs);
  }

  constexpr void check_place(BoardPin function) {
    const int pin = board_.pin(function);
    if (pin == -1) return;
    auto fault = fault_of_place<BoardFault>(chip_, memory_, pin);
    if (fault == BoardFault::kPinStrapping && function == BoardPin::kLed)
      fault = BoardFault::kLedOnStrap;
    if (fault != BoardFault::kNone) tell(fault, function);
    for (size_t i = 0; i < static_cast<size_t>(function); ++i) {
      const auto other = static_cast<BoardPin>(i);
      if (board_.pin(other) != pin) continue;
      report_(BoardIssue{
          .fault = BoardFault::kPinTwice, .function = function, .pin = pin, .other = other});
      return;
    }
  }

  const BoardDescription& board_;
  const ChipTable& chip_;
  const StageTable& stage_;
  PinMask memory_;
  PinMask drivable_;
  Report& report_;
};

/// Calls `report` with each BoardIssue. A usable board has none, or only warnings.
template <typename Report>
constexpr void check_board(const BoardDescription& board, Report&& report) {
  if (board.version != kBoardVersion) {
    report(
        BoardIssue{.fault = BoardFault::kVersion, .value = board.version, .limit = kBoardVersion});
    return;
  }
  const ChipTable* chip = table_of(board.chip);
  const StageTable* stage = table_of(board.stage);
  if (chip == nullptr) report(BoardIssue{.fault = BoardFault::kChip});
  if (stage == nullptr) report(BoardIssue{.fault = BoardFault::kStage});
  if (chip != nullptr && stage != nullptr) BoardCheck(board, *chip, *stage, report).run();
}

/// The first thing that is wrong; `fault` is kNone for a board that can be used.
constexpr BoardIssue first_issue(const BoardDescription& board) {
  BoardIssue first;
  check_board(board, [&first](const BoardIssue& issue) {
    if (first.fault == BoardFault::kNone && !is_warning(issue.fault)) first = issue;
  });
  return first;
}

}  // namespace wheelwire
