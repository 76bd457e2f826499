"""Draw docs/wiring/*.svg: where each wire of an L298N robot goes, as the parts look.

tools/draw_wiring.py            writes them
tools/draw_wiring.py --check    fails when they are not what boards/l298n.yaml says

They are as wide as a phone, so that their text can be read there.
"""

from __future__ import annotations

import sys

import generated
from svg import BLACK, BLUE, GREEN, GREY, ORANGE, PAPER, RED, Picture, svg
from wheelwire.board import Configuration
from wheelwire.tools.files.board import load_board

FOLDER = generated.ROOT / "docs" / "wiring"
WIDTH = 420
PCB, TERMINAL, PLASTIC, METAL = "#b3261e", "#1b6ea8", "#24292f", "#d0a010"
DEVKIT, CASE, UNUSED = "#3b4754", "#eceae4", "#8c959f"

IN_THE_DARK = (
    f'rect[fill="{PAPER}"]:not(.paper), rect[fill="{CASE}"] {{ fill: #2d333b }}',
    f'rect[fill="{PLASTIC}"] {{ stroke: #9da7b3 }}',
)
"""The others keep their colours."""
DEVKITS = {
    "ESP32-DevKitC, 38 pins": (
        "3V3 EN VP VN 34 35 32 33 25 26 27 14 12 GND 13 D2 D3 CMD 5V",
        "GND 23 22 TX RX 21 GND 19 18 5 17 16 4 0 2 15 D1 D0 CLK",
    ),
    "ESP32 DevKit V1, 30 pins": (
        "EN VP VN 34 35 32 33 25 26 27 14 12 13 GND VIN",
        "23 22 TX RX 21 19 18 5 17 16 4 2 15 GND 3V3",
    ),
}
"""The labels printed next to the pins, from the antenna to the USB socket, left and right."""


class Drawing(Picture):
    """The parts as they look."""

    def box(self, x: int, y: int, width: int, height: int, fill: str, stroke: str = "none") -> None:
        """A part, or a piece of one."""
        self.rect(x, y, width, height, rx=4, fill=fill, stroke=stroke, stroke_width=1.5)

    def text(
        self, x: int, y: int, text: str, anchor: str = "start", colour: str = "#111", bold: int = 0
    ) -> None:
        """One line."""
        weight = {"font_weight": "bold"} if bold else {}
        self.add("text", text, x=x, y=y, text_anchor=anchor, fill=colour, **weight)

    def goal(self, x: int, y: int, text: str, colour: str, side: int = 0) -> None:
        """Where a wire leads: around x, or to the left (-1) or right (1) of it."""
        width = 12 + 8 * len(text)
        x += side * width // 2
        self.box(x - width // 2, y - 11, width, 22, colour)
        self.text(x, y + 5, text, "middle", PAPER, bold=1)

    def resistor(self, x: int, y: int, *, lying: bool = False) -> None:
        """34 long, from its upper or left end."""
        size = (x, y - 6, 34, 12) if lying else (x - 6, y, 12, 34)
        self.box(*size, "#f5e6c8", BLACK)


def motor_inputs(board: Configuration) -> list[tuple[str, int | None, str]]:
    """The module's inputs as they lie, with their pins and colours."""
    left, right = board.left, board.right
    return [
        ("ENA", left.enable, ORANGE),
        ("IN1", left.in1, BLUE),
        ("IN2", left.in2, BLUE),
        ("IN3", right.in1, BLUE),
        ("IN4", right.in2, BLUE),
        ("ENB", right.enable, ORANGE),
    ]


def module(board: Configuration) -> str:
    """The red L298N module: its jumpers, both resistors, battery and fuse."""
    edge, bus = 280, 470
    picture = Drawing()
    picture.text(20, 24, "L298N module, seen from above", bold=1)
    picture.box(20, 40, 380, edge - 40, PCB)
    picture.box(150, 52, 120, 74, PLASTIC)
    picture.text(210, 94, "heat sink", "middle", PAPER)
    for x, names, motor in ((20, ("OUT1", "OUT2"), "left motor"), (356, ("OUT3", "OUT4"), "right")):
        for row, name in enumerate(names):
            picture.box(x, 70 + 34 * row, 44, 30, TERMINAL)
            picture.text(x + 22, 90 + 34 * row, name, "middle", PAPER)
        inner, anchor = (x + 52, "start") if x < WIDTH // 2 else (x - 8, "end")
        picture.text(inner, 105, motor if x < WIDTH // 2 else "right motor", anchor, PAPER)
    # The terminals of the supply, and the jumper behind them.
    for x, name in ((50, "+12V"), (90, "GND"), (130, "+5V")):
        picture.box(x - 19, edge - 34, 38, 34, TERMINAL)
        picture.text(x, edge - 13, name, "middle", PAPER)
    picture.box(36, edge - 84, 40, 16, PLASTIC)
    picture.text(82, edge - 71, "5V-EN: stays on", "start", PAPER, bold=1)
    _inputs(picture, board, edge, bus)
    _supply(picture, edge, bus)
    notes = (
        ("ENA, ENB: pull both jumpers off.", 1),
        ("The EN pin is in the row of IN1 to IN4. The pin", 0),
        ("behind it is +5 V: leave it empty. It burns the ESP32.", 0),
        ("5V-EN: leave this jumper on.", 1),
        ("It feeds the module's logic from the battery, which", 0),
        ("must be below 12 V. With all three off nothing moves.", 0),
    )
    for row, (note, bold) in enumerate(notes):
        picture.text(16, 658 + 20 * row, note, bold=bold)
    title = "The red L298N module, its jumpers, resistors, battery and fuse"
    return svg(title, WIDTH, 776, IN_THE_DARK, picture)


def _inputs(picture: Drawing, board: Configuration, edge: int, bus: int) -> None:
    """ENA to ENB with their wires, and the resistors from both EN to ground."""
    picture.text(160, edge + 62, "GPIO", "end", GREY)
    for column, (name, pin, colour) in enumerate(motor_inputs(board)):
        x = 184 + 38 * column
        picture.text(x, edge - 24, name, "middle", PAPER, bold=1)
        picture.wire(colour, (x, edge - 12), (x, edge + 46))
        picture.dot(x, edge - 12, METAL)
        picture.goal(x, edge + 58, str(pin), colour)
        if name.startswith("EN"):
            picture.dot(x, edge - 46, METAL)
            picture.text(x, edge - 55, "+5V", "middle", PAPER)
            picture.wire(PAPER, (x - 6, edge - 52), (x + 6, edge - 40), width=3)
            picture.wire(PAPER, (x - 6, edge - 40), (x + 6, edge - 52), width=3)
        if pin in board.pulldowns:
            picture.dot(x, edge + 20, colour)
            aside = x - 14 if name == "ENA" else x + 24
            picture.wire(colour, (x, edge + 20), (aside, edge + 20), (aside, edge + 100))
            picture.resistor(aside, edge + 100)
            picture.wire(BLACK, (aside, edge + 134), (aside, bus))
    picture.text(288, edge + 112, "10 kΩ from each EN", "middle", bold=1)
    picture.text(288, edge + 130, "to GND, at the module", "middle", bold=1)


def _supply(picture: Drawing, edge: int, bus: int) -> None:
    """The common ground, and the battery behind its fuse."""
    picture.wire(BLACK, (90, edge), (90, bus), (398, bus), width=3)
    picture.goal(300, bus + 30, "GND of the DevKit", PLASTIC)
    picture.wire(BLACK, (300, bus), (300, bus + 19), width=2)
    picture.text(225, bus + 62, "and of both encoders", "start")
    picture.wire(RED, (50, edge), (50, bus + 90), width=3)
    picture.box(40, bus + 22, 20, 44, PAPER, RED)
    picture.text(66, bus + 40, "fuse, 3 A", "start", RED, bold=1)
    picture.wire(BLACK, (150, bus), (150, bus + 90), width=3)
    picture.dot(150, bus, BLACK)
    picture.box(26, bus + 90, 168, 56, CASE, BLACK)
    picture.text(110, bus + 114, "battery, 7.4 V", "middle", bold=1)
    picture.text(110, bus + 133, "two Li-ion cells", "middle")
    picture.text(38, bus + 82, "+", "middle", RED, bold=1)
    picture.text(164, bus + 82, "\N{MINUS SIGN}", "middle", bold=1)


def devkits(board: Configuration) -> str:
    """Both kinds of DevKit: what leads to each pin."""
    picture = Drawing()
    uses = [
        *motor_inputs(board),
        ("left A", board.left.encoder_a, GREEN),
        ("left B", board.left.encoder_b, GREEN),
        ("right A", board.right.encoder_a, GREEN),
        ("right B", board.right.encoder_b, GREEN),
        ("e-stop", board.estop, ORANGE),
        ("LED", board.led, GREY),
    ]
    leads = {str(pin): (use, colour) for use, pin, colour in uses if pin is not None}
    leads["3V3"] = ("both VCC", RED)
    y = 24
    for title, columns in DEVKITS.items():
        picture.text(20, y, title, bold=1)
        rows = [column.split() for column in columns]
        height = 24 * len(rows[0]) + 46
        picture.box(150, y + 12, 120, height, DEVKIT)
        picture.text(210, y + 30, "antenna", "middle", PAPER)
        for row, names in enumerate(zip(*rows, strict=True)):
            for name, right in zip(names, (False, True), strict=True):
                _pin(picture, name, leads.get(name), y + 52 + 24 * row, right=right)
        picture.box(190, y + height - 6, 40, 24, "#b8bec5", BLACK)
        picture.text(210, y + height + 11, "USB", "middle")
        y += height + 60
    picture.text(16, y - 4, "GND: any. 3V3: there is one; both encoders share it.")
    title = "The pins of a 38-pin and of a 30-pin ESP32 DevKit"
    return svg(title, WIDTH, 1064, IN_THE_DARK, picture)


def _pin(picture: Drawing, name: str, lead: tuple[str, str] | None, y: int, *, right: bool) -> None:
    side = 1 if right else -1
    x, anchor = (258, "end") if right else (162, "start")
    colour = PAPER if lead or name == "GND" else UNUSED
    picture.text(x - 10 * side, y + 5, name, anchor, colour, bold=lead is not None)
    picture.dot(x, y, METAL)
    if lead:
        picture.wire(lead[1], (x, y), (x + 38 * side, y))
        picture.goal(x + 38 * side, y, lead[0], lead[1], side)


def plug(board: Configuration) -> str:
    """The six wires of a motor with an encoder, and the divider for one that needs 5 V."""
    picture = Drawing()
    picture.text(20, 24, "Plug of a TT motor with encoder", bold=1)
    picture.box(60, 38, 350, 50, CASE, BLACK)
    columns = (
        ("M+", BLACK, "OUT1", "OUT3"),
        ("M\N{MINUS SIGN}", BLACK, "OUT2", "OUT4"),
        ("VCC", RED, "3V3", "3V3"),
        ("GND", PLASTIC, "GND", "GND"),
        ("A", GREEN, str(board.left.encoder_a), str(board.right.encoder_a)),
        ("B", GREEN, str(board.left.encoder_b), str(board.right.encoder_b)),
    )
    for column, (name, colour, left, right) in enumerate(columns):
        x = 92 + 58 * column
        picture.text(x, 58, name, "middle", bold=1)
        picture.wire(colour, (x, 74), (x, 140), width=3)
        picture.dot(x, 74, METAL, 5)
        picture.goal(x, 140, left, colour)
        picture.goal(x, 206, right, colour)
    picture.text(14, 145, "left", colour=GREY)
    picture.text(60, 182, "The right motor's plug, in the same order:", colour=GREY)
    picture.text(14, 211, "right", colour=GREY)
    picture.text(16, 246, "Makers differ in order and colours: read what is")
    picture.text(16, 264, "printed beside the plug, on the motor's own board.")
    picture.text(16, 302, "VCC: 3V3 if the encoder works at 3.3 V. Else 5 V,", bold=1)
    picture.text(16, 320, "and this divider in each of the four wires A and B:", bold=1)
    picture.text(24, 373, "A, 5 V", colour=GREEN, bold=1)
    picture.wire(GREEN, (76, 368), (130, 368))
    picture.resistor(130, 368, lying=True)
    picture.text(147, 352, "10 kΩ", "middle")
    picture.wire(GREEN, (164, 368), (300, 368))
    picture.goal(338, 368, f"GPIO {board.left.encoder_a}", GREEN)
    picture.dot(226, 368, GREEN)
    picture.wire(GREEN, (226, 368), (226, 392))
    picture.resistor(226, 392)
    picture.text(240, 414, "20 kΩ")
    picture.wire(BLACK, (226, 426), (226, 450))
    picture.goal(226, 458, "GND", PLASTIC)
    picture.text(16, 496, "5 V straight into a GPIO destroys the ESP32.", colour=RED, bold=1)
    title = "The six-wire plug of a TT motor, and a divider for encoders of 5 V"
    return svg(title, WIDTH, 520, IN_THE_DARK, picture)


def main() -> str | None:
    """Write or check the pictures."""
    board = load_board("l298n")
    return generated.write(
        {
            FOLDER / "wiring-module.svg": module(board),
            FOLDER / "wiring-devkits.svg": devkits(board),
            FOLDER / "wiring-plug.svg": plug(board),
        }
    )


if __name__ == "__main__":
    sys.exit(main())
