"""Write docs/boards.md with its pictures, the boards as C++, and a table for the page.

tools/write_boards.py            writes them
tools/write_boards.py --check    fails when they are not what the boards' files say
"""

from __future__ import annotations

import sys

import generated
from board_picture import Wiring
from generated import ROOT
from wheelwire.board import Configuration
from wheelwire.tools.files.board import load_board, shipped_boards
from wheelwire_protocol.board import CHIPS, BoardPin, ChipTable
from wheelwire_protocol.board import MODULES as CHIP_MODULES
from wheelwire_protocol.codes import Chip
from wheelwire_protocol.generate.text import constant_name
from wheelwire_protocol.power_stages import OUTPUTS, STAGES, Action, Level, Stage, StageTable

PAGE = ROOT / "docs" / "boards.md"
PICTURES = ROOT / "docs" / "boards"
CONSTANTS = ROOT / "firmware" / "esp32" / "core" / "built_in_boards.hpp"
SHIPPED = ROOT / "firmware" / "esp32" / "sim" / "shipped_boards.hpp"
PICTURED = ROOT / "web" / "src" / "generated" / "boards.ts"


def _drivable(chip: ChipTable) -> frozenset[int]:
    taken = chip.memory | chip.uart | chip.usb | chip.strapping | chip.input_only
    return chip.existing - taken


def _numbers(pins: frozenset[int]) -> str:
    return ", ".join(map(str, sorted(pins)))


def stages() -> str:
    """The power stages, with the levels of their inputs."""
    return "\n".join(_stage(stage, data) for stage, data in STAGES.items())


def _stage(stage: Stage, data: StageTable) -> str:
    inputs = [name for name in OUTPUTS if name in data.inputs]
    rows = [["", *inputs]] + [
        [action.value, *(data.rows[action].get(name, Level.KEEP).value for name in inputs)]
        for action in Action
    ]
    levels = "\n".join("".join(f"{cell:<11}" for cell in row).rstrip() for row in rows)
    resistors = "Resistors: none where the chip [does not pull up](#pins-while-a-chip-starts)."
    if data.pull_downs:
        names = " and ".join(f"`{name}`" for name in data.pull_downs)
        resistors = f"Resistors: 10 kΩ from each wheel's {names} to ground."
    return f"""\
### {stage.name.lower()}: {data.parts}

```text
{levels}
```

- Coast: {data.coast}
- Brake: {data.brake}
- Release: {data.release}
- Floating: {data.floating}
- PWM: up to {data.max_frequency_hz} Hz ({data.frequency_source}).
- {resistors}
"""


def levels() -> str:
    """The pins that a chip pulls up or drives while it starts."""
    return "".join(
        f"- {chip.name}: {_levels(chip)} ({chip.levels_source})\n" for chip in CHIPS.values()
    )


def _levels(chip: ChipTable) -> str:
    held_high = _numbers(chip.held_high & _drivable(chip))
    return _numbers(chip.pulled_up & _drivable(chip)) + (held_high and f"; held high {held_high}")


def modules() -> str:
    """The pins that a module's memory takes."""
    return "".join(
        f"- {one.name} ({CHIPS[one.chip].name}): {_numbers(one.memory)} ({one.source})\n"
        for one in CHIP_MODULES.values()
    )


def boards() -> str:
    """The picture of each built-in board."""
    shown = {name: load_board(name) for name in shipped_boards()}
    return "\n".join(
        f"### {name}: {board.name}\n\n![wiring of {board.name}](boards/{name}.svg)\n"
        for name, board in shown.items()
    )


IN_IMAGES = {"Esp32": "l298n", "Esp32s3": "esp32s3", "Esp32c6": "esp32c6"}
"""The board of each chip's image, active until another one is written."""


def _header(about: str, namespace: str, body: str) -> str:
    """A header of C++ for descriptions of boards."""
    return f"""\
// {about}; do not edit.
#pragma once

#include "board_rules.hpp"

namespace {namespace} {{

{body}

}}  // namespace {namespace}
"""


def _constant(name: str, board: Configuration) -> str:
    """A board in C++."""
    values = {
        "version": "kBoardVersion",
        "chip": f"Chip::{constant_name(board.chip.name)}",
        "stage": f"Stage::{constant_name(board.stage.name)}",
        "line": f"BoardLine::{constant_name(board.line.name)}",
        "name": f'"{board.name}"',
        **{f.name.lower(): str(pin) for f, pin in board.wiring()},
        "encoder_pulls": f"EncoderPulls::{constant_name(board.encoder_pulls.name)}",
        "estop_contact": f"ContactKind::{constant_name(board.estop_contact.name)}",
        "pwm_frequency_hz": str(board.pwm_frequency_hz),
        "encoder_filter_ns": str(board.encoder_filter_ns),
        "battery_divider_permille": str(round(board.battery_divider * 1000)),
        "pulldowns": " | ".join(f"mask_of({pin})" for pin in sorted(board.pulldowns)) or "0",
    }
    fields = [f"    .{field} = {value}," for field, value in values.items()]
    return "\n".join([f"constexpr BoardDescription {name} = {{", *fields, "};"])


def constants() -> str:
    """firmware/esp32/core/built_in_boards.hpp."""
    boards = "\n\n".join(
        f"{_constant(f'kBoardOf{chip}', load_board(name))}\n"
        f"static_assert(first_issue(kBoardOf{chip}).fault == BoardFault::kNone);"
        for chip, name in IN_IMAGES.items()
    )
    about = "The board of each image, generated by `make gen` from boards/*.yaml"
    return _header(about, "wheelwire", boards)


def shipped() -> str:
    """firmware/esp32/sim/shipped_boards.hpp."""
    boards = {name: load_board(name) for name in shipped_boards()}
    by_chip = sorted(boards, key=lambda name: (boards[name].chip, name))
    names = {name: constant_name(f"board_{name}") for name in by_chip}
    cells = [f'{{"{name}", {names[name]}}},' for name in by_chip]
    # The comments keep a formatter from packing the rows.
    width = max(map(len, cells))
    listed = "\n".join(f"    {row:<{width}}  // {i}" for i, row in enumerate(cells))
    descriptions = "\n\n".join(_constant(names[name], boards[name]) for name in by_chip)
    of_esp32 = sum(board.chip is Chip.ESP32 for board in boards.values())
    body = f"""\
{descriptions}

struct ShippedBoard {{
  const char* name;  ///< Of its file.
  BoardDescription board;
}};

/// Those of the ESP32 come first.
constexpr size_t kShippedBoardsOfEsp32 = {of_esp32};
constexpr ShippedBoard kShippedBoards[] = {{
{listed}
}};"""
    about = "The boards of boards/*.yaml, by chip and name, generated by `make gen`"
    return _header(about, "wheelwire::sim", body)


def pictured() -> str:
    """web/src/generated/boards.ts."""
    rows = []
    for name in shipped_boards():
        board = load_board(name)
        pins = dict(board.wiring())
        pulldowns = sum(1 << pin for pin in board.pulldowns)
        key = [board.chip, board.stage, *(pins.get(pin, -1) for pin in BoardPin), pulldowns]
        rows.append(f'  "{" ".join(str(int(value)) for value in key)}": "{name}",\n')
    return f"""\
// Boards with a picture, generated by `make gen` from boards/*.yaml; do not edit.

/** A picture's name by what it shows: chip, stage, each pin, external pull-downs. */
export const PICTURES: Readonly<Record<string, string>> = {{
{"".join(rows)}}};
"""


def main() -> str | None:
    """Write or check the files."""
    parts = {"stages": stages(), "levels": levels(), "modules": modules(), "boards": boards()}
    pictures = {
        PICTURES / f"{name}.svg": Wiring(load_board(name)).draw() for name in shipped_boards()
    }
    texts = {PAGE: generated.filled(PAGE, parts), CONSTANTS: constants(), SHIPPED: shipped()}
    return generated.write({**pictures, **texts, PICTURED: pictured()})


if __name__ == "__main__":
    sys.exit(main())
