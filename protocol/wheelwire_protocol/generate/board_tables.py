"""The firmware's header about boards: the packed struct, power stages and chips as tables."""

from __future__ import annotations

from collections.abc import Iterable

from ..board import (
    BOARD_VERSION,
    CHIPS,
    MAX_FILTER_NS,
    MIN_FREQUENCY_HZ,
    MODULES,
    OUTPUTS,
    STAGES,
    WARNINGS,
    Action,
    BoardPin,
    Level,
    Stage,
    StageTable,
)
from ..board_layout import BOARD_SIZE, board_fields
from .cpp import cpp_codec, cpp_member
from .cpp_tables import cpp_table
from .text import banner, constant_name


def _mask(pins: Iterable[int]) -> str:
    return f"0x{sum(1 << pin for pin in pins):x}"


def _struct() -> list[str]:
    fields = board_fields()
    return [
        "/// A board as it is sent and stored. Fields that are codes may be unknown ones.",
        "struct BoardDescription {",
        f"  static constexpr size_t kSize = {BOARD_SIZE};",
        "",
        *[cpp_member(f, "-1" if f.format == "b" else "") for f in fields],
        "",
        "  /// The GPIO of a function; -1: none.",
        "  constexpr int pin(BoardPin function) const {",
        "    switch (function) {",
        *[
            f"      case BoardPin::{constant_name(f.name)}:\n        return {f.name.lower()};"
            for f in BoardPin
        ],
        "    }",
        "    return -1;",
        "  }",
        "",
        *cpp_codec("BoardDescription", "board", fields),
    ]


def _levels(table: StageTable, action: Action) -> str:
    row = table.rows[action]
    levels = (row.get(pin, Level.KEEP).name for pin in OUTPUTS)
    return "{" + ", ".join(f"StageLevel::{constant_name(level)}" for level in levels) + "}"


def _stage_row(stage: Stage, table: StageTable) -> str:
    rows = ", ".join(_levels(table, action) for action in Action)
    inputs, pull_downs = (
        _mask(OUTPUTS.index(pin) for pin in pins) for pins in (table.inputs, table.pull_downs)
    )
    flags = f"{str(table.can_coast).lower()}, {str(table.has_standby).lower()}"
    return (
        f"    // {stage.name}\n"
        f"    {{{{{rows}}}, {inputs}, {pull_downs}, {table.max_frequency_hz}, "
        f"{table.pwm_outputs}, {flags}}},"
    )


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
    lines = [
        f"// {banner('Boards')}",
        "#pragma once",
        "",
        '#include "protocol.hpp"',
        "",
        "namespace wheelwire {",
        "",
        f"constexpr uint8_t kBoardVersion = {BOARD_VERSION};",
        f"constexpr uint32_t kMinPwmFrequencyHz = {MIN_FREQUENCY_HZ};",
        f"constexpr uint32_t kMaxFilterNs = {MAX_FILTER_NS};",
        f"constexpr size_t kBoardPinCount = {len(BoardPin)};",
        "",
        *_struct(),
        "/// The inputs of one wheel's power stage, in the order of a board's pins.",
        "enum class StageInput : uint8_t {",
        *[f"  {constant_name(pin)}," for pin in OUTPUTS],
        "};",
        f"constexpr size_t kStageInputs = {len(OUTPUTS)};",
        "",
        "/// What an input gets; kKeep: it stays, or does not exist.",
        "enum class StageLevel : uint8_t {",
        *[f"  {constant_name(level.name)}," for level in Level],
        "};",
        "",
        "enum class StageAction : uint8_t {",
        *[f"  {constant_name(action.name)}," for action in Action],
        "};",
        "",
        "/// Sets of inputs are bits, by StageInput.",
        "struct StageTable {",
        f"  StageLevel rows[{len(Action)}][kStageInputs];  ///< By StageAction.",
        "  uint8_t inputs;",
        "  uint8_t pull_downs;  ///< Inputs that nothing in the stage holds low.",
        "  uint32_t max_frequency_hz;",
        "  uint8_t pwm_outputs;  ///< For each wheel.",
        "  bool can_coast;",
        "  bool has_standby;",
        "};",
        "",
        "/// By Stage.",
        f"constexpr size_t kStages = {len(STAGES)};",
        "constexpr StageTable kStageTables[kStages] = {",
        *[_stage_row(stage, table) for stage, table in STAGES.items()],
        "};",
        "",
        "/// GPIO numbers as bits.",
        "using PinMask = uint64_t;",
        "",
        *cpp_table(
            "ChipTable", "What a chip and its usual modules do with their pins.", _CHIP, CHIPS
        ),
        *cpp_table(
            "ModuleTable",
            "A module that is named has these pins of its chip for flash and PSRAM, and no others.",
            _MODULE,
            MODULES,
        ),
        "/// What is worth a sentence, but refuses no board.",
        "constexpr bool is_warning(BoardFault fault) {",
        "  return "
        + " || ".join(f"fault == BoardFault::{constant_name(f.name)}" for f in sorted(WARNINGS))
        + ";",
        "}",
        "",
        "}  // namespace wheelwire",
        "",
    ]
    return "\n".join(lines)
