"""The picture of a board's wiring: chip, power stage, encoders, battery."""

from __future__ import annotations

from html import escape

from wheelwire.board import Configuration
from wheelwire_protocol.codes import Chip
from wheelwire_protocol.power_stages import OUTPUTS, STAGES

ORANGE, BLUE, GREEN, RED, BLACK = "#bc4c00", "#1f6feb", "#1a7f37", "#cf222e", "#24292f"
GREY, PAPER, FILL, EDGE = "#555", "#ffffff", "#f4f6f8", "#333"
IN_THE_DARK = (
    ".paper { fill: #131416 }",
    'text:not([fill]), text[fill="#111"] { fill: #e6edf3 }',
    f'text[fill="{GREY}"] {{ fill: #9da7b3 }}',
    f'text[fill="{RED}"] {{ fill: #ff7b72 }}',
    f'text[fill="{GREEN}"] {{ fill: #56d364 }}',
    f'[stroke="{BLACK}"] {{ stroke: #adbac7 }}',
    f'circle[fill="{BLACK}"] {{ fill: #adbac7 }}',
    f'[fill="{FILL}"], [fill="#fff"] {{ fill: #22272e }}',
    f'[stroke="{EDGE}"] {{ stroke: #768390 }}',
    'circle[fill="#111"] { fill: #adbac7 }',
)


CHIP_TITLES = {
    Chip.ESP32: ("ESP32-DevKitC", "to the computer by USB"),
    Chip.ESP32S3: ("ESP32-S3-DevKitC-1", "to the computer by USB"),
    Chip.ESP32C6: ("ESP32-C6-DevKitC-1", "to the computer by USB"),
    Chip.LINUX: ("Raspberry Pi", "BCM numbers"),
}
WAYS = {"enable": ORANGE, "pwm": ORANGE, "in1": BLUE, "in2": BLUE, "dir": BLUE}

SIDES = ("left", "right")
WIDTH, TOP = 920, 70
CHIP_LEFT, CHIP_RIGHT = 300, 480
STAGE_LEFT, STAGE_RIGHT = 640, 790
ROW, GAP = 25, 18


class Shapes:
    """The parts of a wiring, as lines of an SVG."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, element: str, text: str | None = None, /, **attributes: object) -> None:
        """An element; in its attributes' names, _ stands for -."""
        named = (f' {name.replace("_", "-")}="{value}"' for name, value in attributes.items())
        end = "/>" if text is None else f">{escape(text)}</{element}>"
        self.lines.append(f"<{element}{''.join(named)}{end}")

    def rect(self, x: int, y: int, width: int, height: int, **attributes: object) -> None:
        """A rectangle, from its upper left corner."""
        self.add("rect", x=x, y=y, width=width, height=height, **attributes)

    def wire(self, colour: str, *points: tuple[int, int], width: int = 2) -> None:
        """A line through the points."""
        path = " ".join(f"{x},{y}" for x, y in points)
        self.add("polyline", points=path, fill="none", stroke=colour, stroke_width=width)

    def dot(self, x: int, y: int, colour: str) -> None:
        """Where wires meet."""
        self.add("circle", cx=x, cy=y, r=3.5, fill=colour)

    def box(self, x: int, y: int, width: int, height: int, title: str, note: str = "") -> None:
        """A part, with its title."""
        self.rect(x, y, width, height, rx=8, fill=FILL, stroke=EDGE, stroke_width=1.5)
        middle = x + width // 2
        self.add("text", title, x=middle, y=y + 22, text_anchor="middle", font_weight="bold")
        if note:
            self.text(middle, y + 39, note, "middle", GREY)

    def text(self, x: int, y: int, text: str, anchor: str = "start", colour: str = "#111") -> None:
        """One line."""
        self.add("text", text, x=x, y=y, text_anchor=anchor, fill=colour, font_size=12)

    def resistor(self, x: int, y: int) -> None:
        """A standing one, 34 high."""
        self.rect(x - 6, y, 12, 34, fill="#fff", stroke=BLACK, stroke_width=1.5)

    def fuse(self, x: int, y: int) -> None:
        """A standing one, 40 high."""
        self.rect(x - 10, y, 20, 40, fill="#fff", stroke=RED, stroke_width=2)
        self.text(x - 16, y + 25, "fuse", "end", RED)

    def motor(self, x: int, y: int, name: str) -> None:
        """A motor, named for its wheel."""
        self.add("circle", cx=x, cy=y, r=27, fill=FILL, stroke=EDGE, stroke_width=1.5)
        self.text(x, y - 1, "M", "middle")
        self.text(x, y + 14, name, "middle")


class Wiring:
    """The wiring of one board: chip, power stage, encoders, battery and what is between them."""

    def __init__(self, board: Configuration) -> None:
        self.board = board
        self.stage = STAGES[board.stage]
        self.module = self.stage.module
        self.inputs = [name for name in OUTPUTS if name in self.stage.inputs]
        self.boxes = Shapes()
        """Under the ends of the wires."""
        self.wires = Shapes()
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
        return self._svg(f"Wiring of {escape(self.board.name)}", end + 45)

    def _svg(self, title: str, height: int) -> str:
        """The file: black on white, in the dark the other way round; wires keep their colours."""
        lines = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
            'font-family="Helvetica, Arial, sans-serif" font-size="13" role="img" '
            'aria-labelledby="title">',
            f'<title id="title">{title}</title>',
            f"<style>@media (prefers-color-scheme: dark) {{ {' '.join(IN_THE_DARK)} }}</style>",
            f'<rect class="paper" width="{WIDTH}" height="{height}" fill="{PAPER}"/>',
            *self.boxes.lines,
            *self.wires.lines,
            "</svg>\n",
        )
        return "\n".join(lines)

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
            self.wires.text(STAGE_LEFT + 8, y + 4, self.module.standby)
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
                label = labels[self.stage.inputs.index(name)]
                self.wires.text(STAGE_LEFT + 8, top + index * ROW + 4, label)

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
