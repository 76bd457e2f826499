"""The firmware's header about boards: the packed struct, power stages and chips as tables."""

from __future__ import annotations

from ..board import (
    BOARD_VERSION,
    CHIPS,
    MAX_FILTER_NS,
    MIN_FREQUENCY_HZ,
    MODULES,
    WARNINGS,
    BoardPin,
)
from ..board_layout import BOARD_SIZE, Board
from ..message import fields_of
from ..power_stages import OUTPUTS, STAGES, Action, Level, Stage, StageTable
from .cpp import cpp_enum, cpp_header, cpp_is_one_of, cpp_struct, cpp_switch
from .cpp_tables import cpp_literal, cpp_table
from .text import constant_name, lines


def _levels(table: StageTable, action: Action) -> str:
    row = table.rows[action]
    levels = (row.get(pin, Level.KEEP).name for pin in OUTPUTS)
    return "{" + ", ".join(f"StageLevel::{constant_name(level)}" for level in levels) + "}"


def _stage_row(stage: Stage, table: StageTable) -> str:
    rows = ", ".join(_levels(table, action) for action in Action)
    inputs, pull_downs = (
        frozenset(OUTPUTS.index(pin) for pin in pins) for pins in (table.inputs, table.pull_downs)
    )
    values = (inputs, pull_downs, table.max_frequency_hz, len(table.pwm_inputs))
    cells = ", ".join(map(cpp_literal, (*values, table.can_coast, table.has_standby)))
    return f"// {stage.name}\n{{{{{rows}}}, {cells}}},"


_CHIP = """
Chip chip
PinMask existing
PinMask strapping Their level at reset selects how the chip starts.
PinMask memory Flash and PSRAM, on any module.
PinMask input_only No output driver and no pull resistors.
PinMask adc
PinMask uart
PinMask usb Of the chip's own USB.
PinMask pulled_up By the chip, until the firmware sets them.
PinMask held_high Until then, against a pull-down, too.
uint8_t counters
uint8_t pwm_outputs
bool has_led
"""
_MODULE = """
Module module
Chip chip
PinMask memory
"""


def generate() -> str:
    """The text of `board_tables.hpp`."""
    constants = f"""\
constexpr uint8_t kBoardVersion = {BOARD_VERSION};
constexpr uint32_t kMinPwmFrequencyHz = {MIN_FREQUENCY_HZ};
constexpr uint32_t kMaxFilterNs = {MAX_FILTER_NS};
constexpr size_t kBoardPinCount = {len(BoardPin)};

/// A board as it is sent and stored. Fields that are codes may be unknown ones."""
    pins = ((f"BoardPin::{constant_name(f.name)}", f.name.lower()) for f in BoardPin)
    pin = cpp_switch("constexpr int pin(BoardPin function) const", pins, "-1")
    board = cpp_struct(
        "BoardDescription",
        "board",
        fields_of(Board),
        f"static constexpr size_t kSize = {BOARD_SIZE};",
        methods=f"/// The GPIO of a function; -1: none.\n{pin}\n\n",
        pin="-1",
    )
    stages = f"""\
/// The inputs of one wheel's power stage, in the order of a board's pins.
{cpp_enum("StageInput", (f"{constant_name(pin)}," for pin in OUTPUTS))}
constexpr size_t kStageInputs = {len(OUTPUTS)};

/// What an input gets; kKeep: it stays, or does not exist.
{cpp_enum("StageLevel", (f"{constant_name(level.name)}," for level in Level))}

{cpp_enum("StageAction", (f"{constant_name(action.name)}," for action in Action))}

/// Sets of inputs are bits, by StageInput.
struct StageTable {{
  StageLevel rows[{len(Action)}][kStageInputs];  ///< By StageAction.
  uint8_t inputs;
  uint8_t pull_downs;  ///< Inputs that nothing in the stage holds low.
  uint32_t max_frequency_hz;
  uint8_t pwm_outputs;  ///< For each wheel.
  bool can_coast;
  bool has_standby;
}};

/// By Stage.
constexpr size_t kStages = {len(STAGES)};
constexpr StageTable kStageTables[kStages] = {{
{lines(_stage_row(stage, table) for stage, table in STAGES.items())}
}};

/// GPIO numbers as bits.
using PinMask = uint64_t;"""
    parts = (
        lines((constants, board)),
        stages,
        cpp_table(
            "ChipTable", "What a chip and its usual modules do with their pins.", _CHIP, CHIPS
        ),
        cpp_table(
            "ModuleTable",
            "A module that is named has these pins of its chip for flash and PSRAM, and no others.",
            _MODULE,
            MODULES,
        ),
        cpp_is_one_of(
            "is_warning(BoardFault fault)",
            "What is worth a sentence, but refuses no board.",
            sorted(WARNINGS),
        ),
    )
    return cpp_header("Boards", '#include "protocol.hpp"', parts)
