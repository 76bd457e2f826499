"""A configuration: a board, the peripherals on it, and whether they can work.

The board says which pins lead to which power stage and encoders. A configuration is data. It is
written as YAML (`files.board`), is sent and stored in packed form, and is checked by the firmware's
own rules.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
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
from wheelwire_protocol.native import BoardIssue, check_board, check_peripherals
from wheelwire_protocol.sensors import MOST_PERIPHERALS, PeripheralFault
from wheelwire_protocol.types import BOARD_LAYOUT

from .errors import ConfigurationError, shown
from .peripherals import (
    EMPTY_ENTRY,
    ENTRY,
    Peripheral,
    packed_entry,
    peripheral_sentence,
    silent_wires,
    unpacked_entry,
)

# Little-endian and without padding, as on the wire.
BOARD = struct.Struct("<" + "".join(letters for _, letters in BOARD_LAYOUT))
_CRC_SIZE = 4
_PACKED_SIZE = BOARD.size + 1 + MOST_PERIPHERALS * ENTRY.size + _CRC_SIZE
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
class Configuration:
    """A board and its peripherals. All pins are GPIO numbers; None: not connected.

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
        peripherals: Sensors, inputs and the battery's levels, by channel.
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
        """The 32-bit checksum that names this configuration; another one has another.

        Raises:
            ConfigurationError: As `packed`.
        """
        return fingerprint_of(self.packed())

    def packed(self) -> bytes:
        """The bytes in which it is stored: the board, how many peripherals count, and these.

        Raises:
            ConfigurationError: A value does not fit into its field, or there are too many
                peripherals.
        """
        if len(self.peripherals) > MOST_PERIPHERALS:
            raise ConfigurationError(f"{self.name}: {self._too_many}")
        return assembled(self._packed_board(), [packed_entry(one) for one in self.peripherals])

    def _packed_board(self) -> bytes:
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
        }
        # The pins' fields have the names of `BoardPin`'s members, in lower case.
        for function in BoardPin:
            pin = self.pin(function)
            values[function.name.lower()] = NO_PIN if pin is None else pin
        try:
            return BOARD.pack(*(values[name] for name in _NAMES))
        except struct.error as error:
            raise ConfigurationError(
                f"the board {self.name!r} cannot be packed: {error}"
            ) from error

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
        return [*found, *self.peripheral_problems()]

    def peripheral_problems(self) -> list[str]:
        """What is wrong with its peripherals on this board; as `problems`."""
        if len(self.peripherals) > MOST_PERIPHERALS:
            return [self._too_many]
        issues = check_peripherals(self.packed())
        # The same problem of two pins is one sentence.
        return list(dict.fromkeys(peripheral_sentence(one, self.peripherals) for one in issues))

    @property
    def _too_many(self) -> str:
        return PeripheralFault.TOO_MANY.doc.format(
            value=len(self.peripherals), limit=MOST_PERIPHERALS
        )

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
            # Without peripherals, which may be too many: the board's rules are its own.
            for issue in check_board(replace(self, peripherals=()).packed())
            if (issue.fault in WARNINGS) == warnings
        ]


def chip_of_pins(chip: Chip) -> Chip:
    """The chip whose pins a device has: a simulated robot has an ESP32's."""
    return Chip.ESP32 if chip is Chip.SIMULATED else chip


def assembled(board: bytes, entries: Sequence[bytes]) -> bytes:
    """The packed configuration of a packed board and its packed entries."""
    left_out = [EMPTY_ENTRY] * (MOST_PERIPHERALS - len(entries))
    body = b"".join((board, bytes([len(entries)]), *entries, *left_out))
    return body + zlib.crc32(body).to_bytes(_CRC_SIZE, "little")


def fingerprint_of(packed: bytes) -> int:
    """The fingerprint of a packed configuration."""
    return int.from_bytes(packed[-_CRC_SIZE:], "little")


def unpacked(data: bytes) -> Configuration:
    """The configuration in its packed form.

    Raises:
        ConfigurationError: It is damaged, or of a version or with codes that are unknown here.
    """
    # Before anything is read: in damaged bytes even the version means nothing.
    body, crc = data[:-_CRC_SIZE], data[-_CRC_SIZE:]
    if len(data) != _PACKED_SIZE or zlib.crc32(body) != int.from_bytes(crc, "little"):
        raise ConfigurationError(f"the board cannot be read: {BoardFault.DAMAGED.doc}")
    values = dict(zip(_NAMES, BOARD.unpack_from(body), strict=True))
    peripheral_count = body[BOARD.size]
    if values["version"] != BOARD_VERSION or peripheral_count > MOST_PERIPHERALS:
        raise ConfigurationError(
            f"the board has format {values['version']} and {peripheral_count} peripherals, and "
            f"this library reads format {BOARD_VERSION}, at most {MOST_PERIPHERALS} peripherals: "
            "update the older one"
        )
    first = BOARD.size + 1
    starts = range(first, first + peripheral_count * ENTRY.size, ENTRY.size)
    peripherals = tuple(unpacked_entry(body[at : at + ENTRY.size]) for at in starts)

    pins = {name: None if values[name] == NO_PIN else values[name] for name in PIN_FUNCTIONS}
    wheel = [f.name for f in fields(WheelPins)]
    try:
        return Configuration(
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
            peripherals=peripherals,
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
