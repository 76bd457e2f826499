"""A board: which pins lead to which power stage and encoders, and whether that can work.

A board is data. It is written as YAML (`board_file`), travels and is kept as a packed struct, and
is checked by the firmware's own rules.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from typing import Any, TypeVar

from wheelwire_protocol.board import (
    BOARD_VERSION,
    CHIPS,
    MODULES,
    NAME_SIZE,
    NO_PIN,
    OUTPUTS,
    STAGES,
    WARNINGS,
    BoardFault,
    BoardLine,
    BoardPin,
    ContactKind,
    EncoderPulls,
    Module,
    Stage,
)
from wheelwire_protocol.codes import Board as Chip
from wheelwire_protocol.native import BoardIssue, check_board
from wheelwire_protocol.types import BOARD_LAYOUT

from .arguments import is_number, top_level
from .errors import ConfigurationError, shown

CHIP_BY_NAME = {table.name: chip for chip, table in CHIPS.items()}
STAGE_BY_NAME = {stage.name.lower(): stage for stage in Stage}
ANY_MODULE = "any"
MODULE_BY_NAME = {
    ANY_MODULE: Module.ANY,
    **{table.name: module for module, table in MODULES.items()},
}
_LINES = {"uart": BoardLine.UART, "usb": BoardLine.USB}
_PULLS = {"internal": EncoderPulls.INTERNAL, "external": EncoderPulls.EXTERNAL}
_CONTACTS = {
    "normally_closed": ContactKind.NORMALLY_CLOSED,
    "normally_open": ContactKind.NORMALLY_OPEN,
}
# Little-endian and without padding, as on the wire.
_FORMAT = "<" + "".join(letters for _, letters in BOARD_LAYOUT)
_NAMES = [name for name, _ in BOARD_LAYOUT]
_CRC_SIZE = 4
# A GPIO travels as a signed byte. Whether the chip has it is for the core's rules to say.
_PIN_LIMIT = 127
_MAX_PERMILLE = 65_535

_Code = TypeVar("_Code")


@dataclass(frozen=True)
class WheelPins:
    """The GPIOs of one wheel; which of the first five there are depends on the stage."""

    enable: int | None = None
    in1: int | None = None
    in2: int | None = None
    pwm: int | None = None
    dir: int | None = None
    encoder_a: int | None = None
    encoder_b: int | None = None


@dataclass(frozen=True)
class BoardDescription:
    """One kind of board. All pins are GPIO numbers; None: not connected.

    Attributes:
        name: At most 24 ASCII characters.
        chip: The chip whose pins these are.
        stage: The power stage of both wheels.
        left: The left wheel's pins.
        right: The right wheel's pins.
        standby: Switches both wheels' outputs off, on stages that have such an input.
        pwm_frequency_hz: Default of the parameter of this name.
        encoder_pulls: What holds the encoders' outputs high.
        encoder_filter_ns: Default of the parameter `glitch_filter_ns`.
        estop: The e-stop contact, against ground.
        estop_contact: What a press does.
        battery: Measures the battery voltage through a divider.
        battery_divider: Battery volts per volt at the pin.
        led: The status LED.
        line: The line to the host.
        pulldowns: Pins with an external resistor to ground.
        module: What carries the chip; it decides which pins its memory takes.
    """

    name: str
    chip: Chip
    stage: Stage
    left: WheelPins
    right: WheelPins
    standby: int | None = None
    pwm_frequency_hz: int = 20_000
    encoder_pulls: EncoderPulls = EncoderPulls.INTERNAL
    encoder_filter_ns: int = 1000
    estop: int | None = None
    estop_contact: ContactKind = ContactKind.NORMALLY_CLOSED
    battery: int | None = None
    battery_divider: float = 4.0
    led: int | None = None
    line: BoardLine = BoardLine.UART
    pulldowns: frozenset[int] = field(default_factory=frozenset)
    module: Module = Module.ANY

    def fingerprint(self) -> int:
        """The 32-bit checksum that names this board; another board has another one.

        Raises:
            ConfigurationError: As `packed`.
        """
        return int.from_bytes(self.packed()[-_CRC_SIZE:], "little")

    def packed(self) -> bytes:
        """The bytes in which it travels and is kept.

        Raises:
            ConfigurationError: A value does not fit into its field.
        """
        # A file with other letters is refused; a program's board gets question marks for them.
        name = self.name.encode("ascii", "replace")
        if len(name) > NAME_SIZE:  # struct would cut it
            raise ConfigurationError(
                f"name = {shown(self.name)}: give it 1 to {NAME_SIZE} characters"
            )
        values: dict[str, Any] = {
            "version": BOARD_VERSION,
            "chip": self.chip,
            "module": self.module,
            "stage": self.stage,
            "line": self.line,
            "name": name,
            "encoder_pulls": self.encoder_pulls,
            "estop_contact": self.estop_contact,
            "pwm_frequency_hz": self.pwm_frequency_hz,
            "encoder_filter_ns": self.encoder_filter_ns,
            # Clamped, so that the rule about dividers refuses it in a sentence of its own.
            "battery_divider_permille": min(round(self.battery_divider * 1000), _MAX_PERMILLE),
            "pulldowns": sum(1 << pin for pin in self.pulldowns),
            "crc": 0,
        }
        # The pins' fields have the names of `BoardPin`'s members, in lower case.
        for function in BoardPin:
            pin = self.pin(function)
            values[function.name.lower()] = NO_PIN if pin is None else pin
        try:
            # Packed with a CRC of 0, which is cut off again: it does not cover itself.
            body = struct.pack(_FORMAT, *(values[name] for name in _NAMES))[:-_CRC_SIZE]
        except struct.error as error:
            raise ConfigurationError(
                f"the board {self.name!r} cannot be packed: {error}"
            ) from error
        return body + zlib.crc32(body).to_bytes(_CRC_SIZE, "little")

    def pin(self, function: BoardPin) -> int | None:
        """The GPIO of a function."""
        # LEFT_ENCODER_A is `left.encoder_a`; STANDBY and the like are attributes of the board.
        side, _, name = function.name.lower().partition("_")
        if side in ("left", "right"):
            return getattr(getattr(self, side), name)  # type: ignore[no-any-return]
        return getattr(self, function.name.lower())  # type: ignore[no-any-return]

    def wiring(self) -> Iterator[tuple[BoardPin, int]]:
        """Each function that is connected, and its GPIO."""
        for function in BoardPin:
            pin = self.pin(function)
            if pin is not None:
                yield function, pin

    def problems(self) -> list[str]:
        """What is wrong with it, a sentence each; empty if it can be used.

        Raises:
            ConfigurationError: A value does not fit into its field.
            NativeMissingError: The firmware's core, whose rules these are, is missing.
        """
        return self._sentences(warnings=False)

    def warnings(self) -> list[str]:
        """What is worth a look although it can be used, a sentence each; raises as `problems`."""
        return self._sentences(warnings=True)

    def _sentences(self, *, warnings: bool) -> list[str]:
        return [
            sentence(issue, self.chip, self.stage)
            for issue in check_board(self.packed())
            if (issue.fault in WARNINGS) == warnings
        ]


def chip_of_pins(chip: Chip) -> Chip:
    """The chip whose pins a device has: a simulated robot has an ESP32's."""
    return Chip.ESP32 if chip is Chip.SIMULATED else chip


def unpacked(data: bytes) -> BoardDescription:
    """The board in a packed struct.

    Raises:
        ConfigurationError: It is damaged, or of a version or with codes that are unknown here.
    """
    # Before anything is read: in damaged bytes even the version means nothing.
    if len(data) != struct.calcsize(_FORMAT) or _crc_of(data) != data[-_CRC_SIZE:]:
        raise ConfigurationError(f"the board cannot be read: {BoardFault.DAMAGED.doc}")
    values = dict(zip(_NAMES, struct.unpack(_FORMAT, data), strict=True))
    if values["version"] != BOARD_VERSION:
        raise ConfigurationError(
            f"the board has format {values['version']}, this library reads {BOARD_VERSION}: "
            "update the older one"
        )

    def pins(prefix: str, names: list[str]) -> dict[str, int | None]:
        found = {name: values[prefix + name] for name in names}
        return {name: None if pin == NO_PIN else pin for name, pin in found.items()}

    wheel = [f.name for f in fields(WheelPins)]
    try:
        return BoardDescription(
            name=values["name"].rstrip(b"\0").decode("ascii", "replace"),
            chip=Chip(values["chip"]),
            module=Module(values["module"]),
            stage=Stage(values["stage"]),
            left=WheelPins(**pins("left_", wheel)),
            right=WheelPins(**pins("right_", wheel)),
            pwm_frequency_hz=values["pwm_frequency_hz"],
            encoder_pulls=EncoderPulls(values["encoder_pulls"]),
            encoder_filter_ns=values["encoder_filter_ns"],
            estop_contact=ContactKind(values["estop_contact"]),
            battery_divider=values["battery_divider_permille"] / 1000,
            line=BoardLine(values["line"]),
            pulldowns=frozenset(pin for pin in range(64) if values["pulldowns"] >> pin & 1),
            **pins("", ["standby", "estop", "battery", "led"]),
        )
    except ValueError as error:
        # From one of the enumerations: a newer release has chips or kinds that this one has not.
        raise ConfigurationError(
            f"a code of the board is unknown: {error}; update wheelwire"
        ) from None


def sentence(issue: BoardIssue, chip: Chip, stage: Stage) -> str:
    """What is wrong and what to do, for a person."""
    title = CHIPS[chip].title if chip in CHIPS else "this chip"
    return issue.fault.doc.format(
        function=issue.function.doc,
        pin=issue.pin,
        other=issue.other.doc,
        chip=title,
        stage=stage.name.lower(),
        value=issue.value,
        limit=issue.limit,
    )


def parse_board(content: object) -> BoardDescription:
    """Build a board from the content of a file: names and types only, for the rest see `problems`.

    Raises:
        ConfigurationError: A key is unknown or missing, or a value is not of its kind.
    """
    reader = _Reader("", content, _TOP)
    # Left out, a section counts as an empty one: none of its keys is required.
    estop = _Reader("estop", reader.get("estop", {}), ["pin", "contact"])
    battery = _Reader("battery", reader.get("battery", {}), ["pin", "divider"])
    return BoardDescription(
        name=reader.name(),
        chip=reader.code("chip", CHIP_BY_NAME),
        module=reader.code("module", MODULE_BY_NAME, ANY_MODULE),
        stage=reader.code("stage", STAGE_BY_NAME),
        left=_wheel("left", reader.get("left")),
        right=_wheel("right", reader.get("right")),
        standby=reader.pin("standby"),
        pwm_frequency_hz=reader.whole("pwm_frequency_hz", 20_000),
        encoder_pulls=reader.code("encoder_pulls", _PULLS, "internal"),
        encoder_filter_ns=reader.whole("encoder_filter_ns", 1000),
        estop=estop.pin("pin"),
        estop_contact=estop.code("contact", _CONTACTS, "normally_closed"),
        battery=battery.pin("pin"),
        battery_divider=battery.number("divider", 4.0),
        led=reader.pin("led"),
        line=reader.code("link", _LINES, "uart"),
        pulldowns=reader.pins("pulldowns"),
    )


def board_mapping(board: BoardDescription) -> dict[str, Any]:
    """The content of a file with this board; `parse_board` makes the same board of it."""
    stage = STAGES[board.stage]
    content: dict[str, Any] = {
        "name": board.name,
        "chip": CHIPS[board.chip].name,
        "stage": board.stage.name.lower(),
    }
    if board.module is not Module.ANY:
        content["module"] = MODULES[board.module].name
    for side in ("left", "right"):
        wheel: WheelPins = getattr(board, side)
        # Also pins that the stage has no input for: a board that breaks a rule is shown as it is.
        names = [*(n for n in OUTPUTS if n in stage.inputs or getattr(wheel, n) is not None)]
        content[side] = {
            name: pin
            for name in (*names, "encoder_a", "encoder_b")
            if (pin := getattr(wheel, name)) is not None
        }
    if board.standby is not None:
        content["standby"] = board.standby
    content["pwm_frequency_hz"] = board.pwm_frequency_hz
    content["encoder_pulls"] = _name_of(board.encoder_pulls, _PULLS)
    content["encoder_filter_ns"] = board.encoder_filter_ns
    # Without a pin the kind of contact means nothing, nor does the divider below.
    if board.estop is not None:
        contact = _name_of(board.estop_contact, _CONTACTS)
        content["estop"] = {"pin": board.estop, "contact": contact}
    if board.battery is not None:
        content["battery"] = {"pin": board.battery, "divider": board.battery_divider}
    if board.led is not None:
        content["led"] = board.led
    content["link"] = _name_of(board.line, _LINES)
    content["pulldowns"] = sorted(board.pulldowns)
    return content


_TOP = [
    *("name", "chip", "module", "stage", "left", "right", "standby"),
    *("pwm_frequency_hz", "encoder_pulls", "encoder_filter_ns"),
    *("estop", "battery", "led", "link", "pulldowns"),
]


class _Reader:
    """A mapping from a file: each value is asked for with the kind that it must have."""

    def __init__(self, section: str, content: object, known: list[str]) -> None:
        self._prefix = f"{section}." if section else ""
        if section and not isinstance(content, Mapping):
            raise ConfigurationError(f"{section} = {shown(content)}: it must be names with values")
        # YAML also has numbers and booleans for keys: as text they are told to be unknown.
        self._values = top_level(content)
        for name, value in self._values.items():
            if name not in known:
                near = get_close_matches(name, known, n=1, cutoff=0.5)
                hint = f"did you mean {near[0]}?" if near else f"the keys are {', '.join(known)}"
                raise ConfigurationError(
                    f"{self._prefix}{name} = {shown(value)}: unknown key; {hint}"
                )

    def get(self, name: str, default: object = None) -> object:
        # Keys without a default are those that every file must have.
        if name not in self._values and default is None:
            raise ConfigurationError(f"{self._prefix}{name} is missing")
        return self._values.get(name, default)

    def name(self) -> str:
        value = self.get("name")
        if not isinstance(value, str) or not value.isascii() or not 0 < len(value) <= NAME_SIZE:
            raise self._refusal("name", value, f"it must be 1 to {NAME_SIZE} ASCII characters")
        return value

    def code(self, name: str, codes: Mapping[str, _Code], default: str | None = None) -> _Code:
        value = self.get(name, default)
        # The type first: a list or a mapping cannot be looked up.
        if not isinstance(value, str) or value not in codes:
            raise self._refusal(name, value, f"choose one of {', '.join(codes)}")
        return codes[value]

    def pin(self, name: str) -> int | None:
        # Not by `get`: any pin may be left out. The rules tell which ones a stage needs.
        value = self._values.get(name)
        return None if value is None else self._checked_pin(name, value)

    def pins(self, name: str) -> frozenset[int]:
        value = self._values.get(name) or []
        if not isinstance(value, list):
            raise self._refusal(name, value, "it must be a list of GPIO numbers")
        # 63 at most: they travel as the bits of one 64-bit number.
        return frozenset(self._checked_pin(name, pin, 63) for pin in value)

    def whole(self, name: str, default: int) -> int:
        value = self.get(name, default)
        # Not isinstance: `yes` in YAML is True, an int, and must not mean 1.
        if type(value) is not int or not 0 <= value <= 65_535:
            raise self._refusal(name, value, "it must be a whole number, 0 to 65535")
        return value

    def number(self, name: str, default: float) -> float:
        value = self.get(name, default)
        if isinstance(value, (int, float)) and is_number(value) and value > 0:
            return float(value)
        raise self._refusal(name, value, "it must be a number above 0")

    def _checked_pin(self, name: str, value: object, last: int = _PIN_LIMIT) -> int:
        # True is an int, too, but no GPIO.
        if type(value) is not int or not 0 <= value <= last:
            raise self._refusal(name, value, "it must be the number of a GPIO")
        return value

    def _refusal(self, name: str, value: object, rule: str) -> ConfigurationError:
        return ConfigurationError(f"{self._prefix}{name} = {shown(value)}: {rule}")


def _wheel(side: str, content: object) -> WheelPins:
    names = [f.name for f in fields(WheelPins)]
    reader = _Reader(side, content, names)
    return WheelPins(**{name: reader.pin(name) for name in names})


def _name_of(code: _Code, codes: Mapping[str, _Code]) -> str:
    return next(name for name, value in codes.items() if value == code)


def _crc_of(data: bytes) -> bytes:
    return zlib.crc32(data[:-_CRC_SIZE]).to_bytes(_CRC_SIZE, "little")
