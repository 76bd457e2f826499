"""Draw docs/boards/*.svg; write docs/boards.md, the boards as C++, and a table for the page.

tools/write_boards.py            writes them
tools/write_boards.py --check    fails when they are not what the boards' files say
"""

from __future__ import annotations

import sys
from html import escape
from typing import NamedTuple

import generated
from generated import ROOT
from wheelwire.board import Configuration
from wheelwire.tools.files.board import load_board, shipped_boards
from wheelwire_protocol.board import (
    CHIPS,
    OUTPUTS,
    STAGES,
    Action,
    BoardPin,
    ChipTable,
    Level,
    Stage,
    StageTable,
)
from wheelwire_protocol.board import MODULES as CHIP_MODULES
from wheelwire_protocol.codes import Chip
from wheelwire_protocol.generate.text import constant_name

PAGE = ROOT / "docs" / "boards.md"
PICTURES = ROOT / "docs" / "boards"
CONSTANTS = ROOT / "firmware" / "esp32" / "core" / "built_in_boards.hpp"
SHIPPED = ROOT / "firmware" / "esp32" / "sim" / "shipped_boards.hpp"
PICTURED = ROOT / "web" / "src" / "generated" / "boards.ts"

ORANGE, BLUE, GREEN, RED, BLACK = "#bc4c00", "#1f6feb", "#1a7f37", "#cf222e", "#24292f"
GREY, FILL = "#555", "#f4f6f8"


def in_the_dark(*rules: str) -> str:
    """The style of a picture that is black on white, and in the dark the other way round.

    Args:
        rules: CSS of this picture alone. The wires keep their colours.
    """
    shared = (
        ".paper { fill: #131416 }",
        'text:not([fill]), text[fill="#111"] { fill: #e6edf3 }',
        f'text[fill="{GREY}"] {{ fill: #9da7b3 }}',
        f'text[fill="{RED}"] {{ fill: #ff7b72 }}',
        f'text[fill="{GREEN}"] {{ fill: #56d364 }}',
        f'[stroke="{BLACK}"] {{ stroke: #adbac7 }}',
        f'circle[fill="{BLACK}"] {{ fill: #adbac7 }}',
    )
    return f"<style>@media (prefers-color-scheme: dark) {{ {' '.join((*shared, *rules))} }}</style>"


PARTS_IN_THE_DARK = (
    f'[fill="{FILL}"], [fill="#fff"] {{ fill: #22272e }}',
    '[stroke="#333"] { stroke: #768390 }',
    'circle[fill="#111"] { fill: #adbac7 }',
)


class Module(NamedTuple):
    """What is printed on a driver module's pins."""

    title: str
    note: str
    left: dict[str, str]
    right: dict[str, str]
    outputs: tuple[str, str, str, str]
    supply: str
    logic: str = ""
    """Its own supply's pin, from 3.3 V of the chip."""
    one_each: bool = False
    """A module for each wheel."""


MODULES = {
    Stage.ENABLE_IN1_IN2: Module(
        "L298N",
        "EN jumpers off, 5V-EN on",
        {"enable": "ENA", "in1": "IN1", "in2": "IN2"},
        {"enable": "ENB", "in1": "IN3", "in2": "IN4"},
        ("OUT1", "OUT2", "OUT3", "OUT4"),
        "12 V in",
    ),
    Stage.PWM_IN1_IN2: Module(
        "TB6612FNG",
        "",
        {"pwm": "PWMA", "in1": "AIN1", "in2": "AIN2"},
        {"pwm": "PWMB", "in1": "BIN1", "in2": "BIN2"},
        ("AO1", "AO2", "BO1", "BO2"),
        "VM",
        logic="VCC",
    ),
    Stage.IN_IN: Module(
        "DRV8833",
        "",
        {"in1": "AIN1", "in2": "AIN2"},
        {"in1": "BIN1", "in2": "BIN2"},
        ("AOUT1", "AOUT2", "BOUT1", "BOUT2"),
        "VM",
    ),
    Stage.HALF_BRIDGES: Module(
        "BTS7960",
        "one each",
        {"enable": "R_EN + L_EN", "in1": "RPWM", "in2": "LPWM"},
        {"enable": "R_EN + L_EN", "in1": "RPWM", "in2": "LPWM"},
        ("M+", "M-", "M+", "M-"),
        "B+",
        logic="VCC",
        one_each=True,
    ),
    Stage.PWM_DIR: Module(
        "MDD10A",
        "it cannot coast",
        {"pwm": "PWM1", "dir": "DIR1"},
        {"pwm": "PWM2", "dir": "DIR2"},
        ("M1A", "M1B", "M2A", "M2B"),
        "POWER +",
    ),
}
STANDBY = {Stage.PWM_IN1_IN2: "STBY", Stage.IN_IN: "nSLEEP"}
CHIP_TITLES = {
    Chip.ESP32: ("ESP32-DevKitC", "to the computer by USB"),
    Chip.ESP32S3: ("ESP32-S3-DevKitC-1", "to the computer by USB"),
    Chip.ESP32C6: ("ESP32-C6-DevKitC-1", "to the computer by USB"),
    Chip.LINUX: ("Raspberry Pi", "BCM numbers"),
}
WAYS = {"enable": ORANGE, "pwm": ORANGE, "in1": BLUE, "in2": BLUE, "dir": BLUE}

SIDES = ("left", "right")
CHIP_LEFT, CHIP_RIGHT, TOP = 300, 480, 70
STAGE_LEFT, STAGE_RIGHT = 640, 790
ROW, GAP = 25, 18


class Picture:
    """Shapes, as lines of an SVG."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def box(self, x: int, y: int, width: int, height: int, title: str, note: str = "") -> None:
        """A part, with its title."""
        self.lines.append(
            f'<rect x="{x}" y="{y}" width="{width}" height="{height}" rx="8" fill="{FILL}" '
            'stroke="#333" stroke-width="1.5"/>'
        )
        middle = x + width // 2
        self.lines.append(
            f'<text x="{middle}" y="{y + 22}" text-anchor="middle" font-weight="bold">'
            f"{escape(title)}</text>"
        )
        if note:
            self.text(middle, y + 39, note, "middle", GREY)

    def text(self, x: int, y: int, text: str, anchor: str = "start", colour: str = "#111") -> None:
        """One line."""
        self.lines.append(
            f'<text x="{x}" y="{y}" text-anchor="{anchor}" fill="{colour}" font-size="12">'
            f"{escape(text)}</text>"
        )

    def wire(self, colour: str, *points: tuple[int, int], width: int = 2) -> None:
        """A line through the points."""
        path = " ".join(f"{x},{y}" for x, y in points)
        self.lines.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width}"/>'
        )

    def dot(self, x: int, y: int, colour: str) -> None:
        """Where wires meet."""
        self.lines.append(f'<circle cx="{x}" cy="{y}" r="3.5" fill="{colour}"/>')

    def resistor(self, x: int, y: int) -> None:
        """A standing one, 34 high."""
        self.lines.append(
            f'<rect x="{x - 6}" y="{y}" width="12" height="34" fill="#fff" stroke="{BLACK}" '
            'stroke-width="1.5"/>'
        )

    def fuse(self, x: int, y: int) -> None:
        """A standing one, 40 high."""
        self.lines.append(
            f'<rect x="{x - 10}" y="{y}" width="20" height="40" fill="#fff" stroke="{RED}" '
            'stroke-width="2"/>'
        )
        self.text(x - 16, y + 25, "fuse", "end", RED)

    def motor(self, x: int, y: int, name: str) -> None:
        """A motor, named for its wheel."""
        self.lines.append(
            f'<circle cx="{x}" cy="{y}" r="27" fill="{FILL}" stroke="#333" stroke-width="1.5"/>'
        )
        self.text(x, y - 1, "M", "middle")
        self.text(x, y + 14, name, "middle")


def svg(title: str, height: int, *pictures: Picture) -> str:
    """The pictures, each over the one before, as a file."""
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 920 {height}" '
            'font-family="Helvetica, Arial, sans-serif" font-size="13" role="img" '
            'aria-labelledby="title">',
            f'<title id="title">{escape(title)}</title>',
            in_the_dark(*PARTS_IN_THE_DARK),
            f'<rect class="paper" width="920" height="{height}" fill="#ffffff"/>',
            *(line for picture in pictures for line in picture.lines),
            "</svg>",
            "",
        ]
    )


class Wiring:
    """The wiring of one board: chip, power stage, encoders, battery and what is between them."""

    def __init__(self, board: Configuration) -> None:
        self.board = board
        self.module = MODULES[board.stage]
        self.inputs = [name for name in OUTPUTS if name in STAGES[board.stage].inputs]
        self.boxes = Picture()
        """Under the ends of the wires."""
        self.wires = Picture()
        self.tops: list[int] = []
        """Tops of each wheel's first input of the stage."""
        self.middles: list[int] = []
        """Middles of each wheel's motor."""
        self.pulled: list[int] = []

    def draw(self) -> str:
        """The picture as SVG."""
        left, stage_bottom = self._left_of_chip(), self._stage()
        ground = max(stage_bottom + 95, TOP + 300)
        bottom = max(ground + 30, left)
        title, note = CHIP_TITLES[self.board.chip]
        self.boxes.box(CHIP_LEFT, TOP, CHIP_RIGHT - CHIP_LEFT, bottom - TOP, title, note)
        self._stage_boxes(stage_bottom)
        self._motors()
        self._pulldowns(ground)
        self._grounds(ground, stage_bottom)
        self._battery(ground)
        end = max(bottom, ground + 110)
        self.wires.text(40, end + 25, "Thick: motor current.", "start", GREY)
        return svg(f"Wiring of {self.board.name}", end + 45, self.boxes, self.wires)

    def _stage(self) -> int:
        """What leads from the chip to the power stage; returns where the stage ends."""
        y = TOP + 60
        for wheel, extra in (
            (self.board.left, 60 if self.module.one_each else 0),
            (self.board.right, 0),
        ):
            self.tops.append(y)
            self.middles.append(y + max(ROW, (len(self.inputs) - 1) * ROW) // 2)
            for index, name in enumerate(self.inputs):
                pin = getattr(wheel, name)
                row = y + index * ROW
                self._to_stage(row, f"GPIO {pin}", WAYS[name])
                if pin in self.board.pulldowns:
                    self.pulled.append(row)
            y += max(len(self.inputs), 3) * ROW + GAP + extra
        if self.board.standby is not None:
            self._to_stage(y, f"GPIO {self.board.standby}", BLUE)
            self.wires.text(STAGE_LEFT + 8, y + 4, STANDBY[self.board.stage])
            y += ROW
        if self.module.logic:
            self._to_stage(y, "3V3", RED)
            of_both = " of both" if self.module.one_each else ""
            self.wires.text(STAGE_LEFT + 8, y + 4, self.module.logic + of_both)
            y += ROW
        return y + 22

    def _to_stage(self, y: int, label: str, colour: str) -> None:
        self.wires.text(CHIP_RIGHT - 8, y + 4, label, "end")
        self.wires.wire(colour, (CHIP_RIGHT, y), (STAGE_LEFT, y))

    def _stage_boxes(self, bottom: int) -> None:
        width = STAGE_RIGHT - STAGE_LEFT
        module = self.module
        if not module.one_each:
            self.boxes.box(STAGE_LEFT, TOP, width, bottom - TOP, module.title, module.note)
        for top, side, labels in zip(self.tops, SIDES, (module.left, module.right), strict=True):
            if module.one_each:
                title = f"{module.title}, {side}"
                self.boxes.box(STAGE_LEFT, top - 42, width, 42 + 3 * ROW, title)
            for index, name in enumerate(self.inputs):
                self.wires.text(STAGE_LEFT + 8, top + index * ROW + 4, labels[name])

    def _left_of_chip(self) -> int:
        """Encoders, e-stop and LED; returns where they end."""
        board, y = self.board, TOP + 62
        for side, wheel in zip(SIDES, (board.left, board.right), strict=True):
            # A DevKit has one such pin.
            supply = "3V3" if side == "left" else "the same 3V3"
            rows = (
                ("A", f"GPIO {wheel.encoder_a}", GREEN),
                ("B", f"GPIO {wheel.encoder_b}", GREEN),
                ("3V3", supply, RED),
                ("GND", "GND", BLACK),
            )
            self.boxes.box(40, y - 42, 130, 42 + 18 * len(rows), f"{side.capitalize()} encoder")
            for label, at_chip, colour in rows:
                self.wires.text(162, y + 4, label, "end")
                self._to_chip(y, at_chip, colour)
                y += 18
            y += 62
        if board.estop is not None:
            contact = board.estop_contact.name.lower().replace("_", " ")
            y = self._two_wires(y, "E-stop", contact, board.estop, ORANGE) + 40
        if board.led is not None:
            y = self._two_wires(y, "LED", "1 kΩ in series", board.led, BLUE) + 30
        return y

    def _two_wires(self, y: int, title: str, note: str, pin: int, colour: str) -> int:
        self.boxes.box(40, y - 17, 130, 50, title, note)
        self._to_chip(y, f"GPIO {pin}", colour)
        self._to_chip(y + 20, "GND", BLACK)
        return y + 40

    def _to_chip(self, y: int, label: str, colour: str) -> None:
        self.wires.wire(colour, (170, y), (CHIP_LEFT, y))
        self.wires.text(CHIP_LEFT + 8, y + 4, label)

    def _motors(self) -> None:
        outputs = iter(self.module.outputs)
        for middle, side in zip(self.middles, SIDES, strict=True):
            self.wires.motor(850, middle, side)
            for y in (middle - 12, middle + 12):
                self.wires.wire(BLACK, (STAGE_RIGHT, y), (828, y), width=3)
                self.wires.text(STAGE_RIGHT - 8, y + 4, next(outputs), "end")

    def _pulldowns(self, ground: int) -> None:
        for index, y in enumerate(self.pulled):
            x = 540 + 40 * index
            self.wires.dot(x, y, ORANGE)
            self.wires.wire(ORANGE, (x, y), (x, ground - 65))
            self.wires.resistor(x, ground - 65)
            self.wires.wire(BLACK, (x, ground - 31), (x, ground))
        if self.pulled:
            self.wires.text(540 + 40 * len(self.pulled) - 28, ground - 44, "10 kΩ each")

    def _grounds(self, y: int, stage_bottom: int) -> None:
        one_each = self.module.one_each
        self.wires.wire(BLACK, (CHIP_RIGHT, y), (890, y), width=3)
        self.wires.text(CHIP_RIGHT - 8, y + 4, "GND", "end")
        self.wires.text(806, y + 18, "common ground, one point", "end", GREY)
        stage_ground = self.tops[1] + 3 * ROW if one_each else stage_bottom
        self.wires.wire(BLACK, (755, stage_ground), (755, y), width=3)
        self.wires.text(763, y - 20, "GND of both" if one_each else "GND")
        self.wires.dot(755, y, "#111")

    def _battery(self, ground: int) -> None:
        self.wires.box(740, ground + 45, 150, 50, "Battery", "of the motors' voltage")
        self.wires.wire(BLACK, (815, ground + 45), (815, ground), width=3)
        self.wires.text(822, ground + 40, "\N{MINUS SIGN}")
        one_each = self.module.one_each
        top = self.tops[0] - 42 if one_each else TOP
        way = ((890, ground + 70), (906, ground + 70), (906, 40), (750, 40), (750, top))
        self.wires.wire(RED, *way, width=3)
        supply = self.module.supply + (" of both" if one_each else "")
        self.wires.text(756, 60, supply, "start", RED)
        self.wires.fuse(906, ground - 60)
        self.wires.dot(815, ground, "#111")


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


def _initializers(board: Configuration) -> list[str]:
    """The fields of a BoardDescription in C++."""
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
    return [f"    .{field} = {value}," for field, value in values.items()]


def constants() -> str:
    """firmware/esp32/core/built_in_boards.hpp."""
    lines = [
        "// The board of each image, generated by `make gen` from boards/*.yaml; do not edit.",
        "#pragma once",
        "",
        '#include "board_rules.hpp"',
        "",
        "namespace wheelwire {",
        "",
    ]
    for chip, name in IN_IMAGES.items():
        board = load_board(name)
        lines += [
            f"constexpr BoardDescription kBoardOf{chip} = {{",
            *_initializers(board),
            "};",
            f"static_assert(first_issue(kBoardOf{chip}).fault == BoardFault::kNone);",
            "",
        ]
    return "\n".join([*lines, "}  // namespace wheelwire", ""])


def shipped() -> str:
    """firmware/esp32/sim/shipped_boards.hpp."""
    boards = {name: load_board(name) for name in shipped_boards()}
    by_chip = sorted(boards, key=lambda name: (boards[name].chip, name))
    lines = [
        "// The boards of boards/*.yaml, by chip and name, generated by `make gen`; do not edit.",
        "#pragma once",
        "",
        '#include "board_rules.hpp"',
        "",
        "namespace wheelwire::sim {",
        "",
    ]
    for name in by_chip:
        lines += [
            f"constexpr BoardDescription {constant_name(f'board_{name}')} = {{",
            *_initializers(boards[name]),
            "};",
            "",
        ]
    # The comments keep a formatter from packing the rows.
    rows = [f'{{"{name}", {constant_name(f"board_{name}")}}},' for name in by_chip]
    of_esp32 = sum(board.chip is Chip.ESP32 for board in boards.values())
    lines += [
        "struct ShippedBoard {",
        "  const char* name;  ///< Of its file.",
        "  BoardDescription board;",
        "};",
        "",
        "/// Those of the ESP32 come first.",
        f"constexpr size_t kShippedBoardsOfEsp32 = {of_esp32};",
        "constexpr ShippedBoard kShippedBoards[] = {",
        *(f"    {row:<{max(map(len, rows))}}  // {i}" for i, row in enumerate(rows)),
        "};",
        "",
        "}  // namespace wheelwire::sim",
        "",
    ]
    return "\n".join(lines)


def pictured() -> str:
    """web/src/generated/boards.ts."""
    rows = []
    for name in shipped_boards():
        board = load_board(name)
        pins = dict(board.wiring())
        pulldowns = sum(1 << pin for pin in board.pulldowns)
        key = [board.chip, board.stage, *(pins.get(pin, -1) for pin in BoardPin), pulldowns]
        rows.append(f'  "{" ".join(str(int(value)) for value in key)}": "{name}",')
    return "\n".join(
        [
            "// Boards with a picture, generated by `make gen` from boards/*.yaml; do not edit.",
            "",
            "/** A picture's name by what it shows: chip, stage, each pin, external pull-downs. */",
            "export const PICTURES: Readonly<Record<string, string>> = {",
            *rows,
            "};",
            "",
        ]
    )


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
