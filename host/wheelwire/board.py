"""A board: which pins lead to which power stage and encoders, and whether that can work.

A board is data. It is written as YAML (`files.board`), is sent and stored as a packed struct, and
is checked by the firmware's own rules.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any

from wheelwire_protocol.board import (
    BOARD_VERSION,
    CHIPS,
    NAME_SIZE,
    NO_PIN,
    PIN_FUNCTIONS,
    WARNINGS,
    BoardFault,
    BoardLine,
    BoardPin,
    ContactKind,
    EncoderPulls,
    Module,
    Stage,
)
from wheelwire_protocol.codes import Chip
from wheelwire_protocol.native import BoardIssue, check_board
from wheelwire_protocol.types import BOARD_LAYOUT

from .errors import ConfigurationError, shown
from .peripherals import CRC_SIZE, Peripheral, peripheral_problems, sealed, silent_wires

# Little-endian and without padding, as on the wire.
PACKED = struct.Struct("<" + "".join(letters for _, letters in BOARD_LAYOUT))
_NAMES = [name for name, _ in BOARD_LAYOUT]
_MAX_PERMILLE = 65_535


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
        peripherals: Sensors, inputs and the battery's levels, by channel. A device stores them
            beside the board: they are no part of its packed form, nor of its fingerprint.
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
    peripherals: tuple[Peripheral, ...] = ()

    def fingerprint(self) -> int:
        """The 32-bit checksum that names this board; another board has another one.

        Raises:
            ConfigurationError: As `packed`.
        """
        return int.from_bytes(self.packed()[-CRC_SIZE:], "little")

    def packed(self) -> bytes:
        """The bytes in which it is sent and stored.

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
            body = PACKED.pack(*(values[name] for name in _NAMES))[:-CRC_SIZE]
        except struct.error as error:
            raise ConfigurationError(
                f"the board {self.name!r} cannot be packed: {error}"
            ) from error
        return sealed(body)

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
        """What is wrong with it and its peripherals, a sentence each; empty if it can be used.

        Raises:
            ConfigurationError: A value does not fit into its field.
            NativeMissingError: The firmware's core, whose rules these are, is missing.
        """
        found = self._sentences(warnings=False)
        return [*found, *peripheral_problems(self.peripherals, self.packed())]

    def warnings(self) -> list[str]:
        """What is worth a look although it can be used, a sentence each; raises as `problems`."""
        found = self._sentences(warnings=True)
        if self.estop is not None and self.estop_contact is ContactKind.NORMALLY_OPEN:
            found.append(
                f"estop = {self.estop}: a normally open contact does nothing if its wire breaks, "
                "and nobody notices: use a normally closed one"
            )
        return [*found, *silent_wires(self.peripherals)]

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
    if len(data) != PACKED.size or sealed(data[:-CRC_SIZE]) != data:
        raise ConfigurationError(f"the board cannot be read: {BoardFault.DAMAGED.doc}")
    values = dict(zip(_NAMES, PACKED.unpack(data), strict=True))
    if values["version"] != BOARD_VERSION:
        raise ConfigurationError(
            f"the board has format {values['version']}, this library reads {BOARD_VERSION}: "
            "update the older one"
        )

    pins = {name: None if values[name] == NO_PIN else values[name] for name in PIN_FUNCTIONS}
    wheel = [f.name for f in fields(WheelPins)]
    try:
        return BoardDescription(
            name=values["name"].rstrip(b"\0").decode("ascii", "replace"),
            chip=Chip(values["chip"]),
            module=Module(values["module"]),
            stage=Stage(values["stage"]),
            left=WheelPins(**{name: pins[f"left_{name}"] for name in wheel}),
            right=WheelPins(**{name: pins[f"right_{name}"] for name in wheel}),
            pwm_frequency_hz=values["pwm_frequency_hz"],
            encoder_pulls=EncoderPulls(values["encoder_pulls"]),
            encoder_filter_ns=values["encoder_filter_ns"],
            estop_contact=ContactKind(values["estop_contact"]),
            battery_divider=values["battery_divider_permille"] / 1000,
            line=BoardLine(values["line"]),
            pulldowns=frozenset(pin for pin in range(64) if values["pulldowns"] >> pin & 1),
            peripherals=(),
            **{name: pins[name] for name in ("standby", "estop", "battery", "led")},
        )
    except ValueError as error:
        # From one of the enumerations: a newer release has chips or kinds that this one has not.
        raise ConfigurationError(
            f"this release does not know a code of the robot's board ({error}): update wheelwire"
        ) from None


def sentence(issue: BoardIssue, chip: Chip, stage: Stage) -> str:
    """The sentence for a person: what is wrong, and what to do."""
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
