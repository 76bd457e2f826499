"""A configuration: a board, the peripherals on it, and whether they can work.

The board says which pins lead to which power stage and encoders. Peripherals are sensors, inputs
and the battery's levels; the index of a peripheral is its channel. A configuration is data: people
write it as YAML (`tools.files.board`), links and devices use the packed form, and the firmware's
own rules check it.
"""

from __future__ import annotations

import enum
import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, TypeAlias

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
)
from wheelwire_protocol.codec import BOARD, ENTRY, assembled, fingerprint_of
from wheelwire_protocol.codes import MOST_PERIPHERALS, Chip, PeripheralKind, Place, channel_name
from wheelwire_protocol.core import BoardIssue, PeripheralIssue, check_board, check_peripherals
from wheelwire_protocol.peripherals import IMUS, Axis, PeripheralFault, PeripheralFlag, SensorChip
from wheelwire_protocol.power_stages import Stage
from wheelwire_protocol.types import BOARD_LAYOUT, PERIPHERAL_LAYOUT

from .errors import ConfigurationError, shown

_ENTRY_FIELDS = [name for name, _ in PERIPHERAL_LAYOUT]
_PINS = ("pin_a", "pin_b", "pin_c")
_VALUES = ("value_a", "value_b", "value_c")
# An entry has unsigned numbers only; a bias is in two's complement.
_HALF, _COUNTS = 0x8000, 0x1_0000
_BIAS_DIGITS = 5
"""Decimals of a bias in rad/s: enough for one count of any chip."""

_CRC_SIZE = 4
_PACKED_SIZE = BOARD.size + 1 + MOST_PERIPHERALS * ENTRY.size + _CRC_SIZE
_BOARD_FIELDS = [name for name, _ in BOARD_LAYOUT]
_MAX_PERMILLE = 65_535


class Pull(enum.Enum):
    """What holds a digital input's pin."""

    INTERNAL = "internal"
    """The chip's own pull-up."""
    EXTERNAL = "external"
    """Resistors or the sensor's own output; the chip's are off."""
    DOWN = "down"
    """The chip's own pull-down."""


_PULL_FLAGS = {
    Pull.INTERNAL: PeripheralFlag.PULL_UP,
    Pull.DOWN: PeripheralFlag.PULL_DOWN,
    Pull.EXTERNAL: PeripheralFlag(0),
}


@dataclass(frozen=True)
class ImuSensor:
    """Gyroscope and accelerometer on an I2C bus. Pins are GPIO numbers.

    Attributes:
        chip: The IMU's chip.
        sda: The bus's data line.
        scl: The bus's clock line.
        interrupt: The chip's data-ready output; None: not connected.
        forward: The printed axis that points forward on the robot.
        up: The printed axis that points up.
        address: Address on the bus; None: the chip's usual one.
        bias: What the gyroscope measures at rest, about the chip's own x, y and z, to be subtracted
            from each sample. Stored in whole counts of the chip. [rad/s]
        bus: Number of a computer's bus, in place of its pins.
    """

    kind: ClassVar[PeripheralKind] = PeripheralKind.IMU
    place: ClassVar[Place] = Place.NONE

    chip: SensorChip
    sda: int | None
    scl: int | None
    interrupt: int | None = None
    forward: Axis = Axis.X
    up: Axis = Axis.Z
    address: int | None = None
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bus: int | None = None


@dataclass(frozen=True)
class PowerSensor:
    """Voltage and current of the supply, by a chip on an I2C bus. Pins are GPIO numbers.

    Attributes:
        chip: The power sensor's chip.
        sda: The bus's data line.
        scl: The bus's clock line.
        shunt_mohm: The resistor through which the current flows. [mOhm]
        address: Address on the bus; None: the chip's usual one.
        bus: Number of a computer's bus, in place of its pins.
    """

    kind: ClassVar[PeripheralKind] = PeripheralKind.POWER
    place: ClassVar[Place] = Place.NONE

    chip: SensorChip
    sda: int | None
    scl: int | None
    shunt_mohm: float
    address: int | None = None
    bus: int | None = None


@dataclass(frozen=True)
class BatteryLevels:
    """Voltages of the battery below which the robot acts. All 0: the robot only measures it.

    Attributes:
        warn_v: Below it the robot warns. [V]
        limit_v: Below it the robot drives at half its speed at most. [V]
        stop_v: Below it the robot stops, until the battery is charged. [V]
    """

    kind: ClassVar[PeripheralKind] = PeripheralKind.BATTERY
    place: ClassVar[Place] = Place.NONE

    warn_v: float = 0.0
    limit_v: float = 0.0
    stop_v: float = 0.0

    @property
    def is_guarded(self) -> bool:
        """Whether there is any level."""
        return any((self.warn_v, self.limit_v, self.stop_v))


@dataclass(frozen=True)
class DigitalInput:
    """A bumper, a cliff sensor or the fault output of a power stage.

    Attributes:
        kind: One of BUMPER, CLIFF and STAGE_FAULT.
        place: Place on the robot.
        pin: GPIO of the input.
        triggered_low: Whether the low level triggers the input; otherwise the high one does.
        pull: What holds the pin.
    """

    kind: PeripheralKind
    place: Place
    pin: int | None
    triggered_low: bool = False
    pull: Pull = Pull.INTERNAL


@dataclass(frozen=True)
class RangeSensor:
    """Measures the distance to what is ahead of it, by the echo of a sound. Pins are GPIO numbers.

    Attributes:
        chip: The sensor's type.
        place: Place on the robot.
        trigger: The pin that starts a measurement.
        echo: The pin at the sensor's output, through a divider if that has 5 V.
    """

    kind: ClassVar[PeripheralKind] = PeripheralKind.RANGE

    chip: SensorChip
    place: Place
    trigger: int | None
    echo: int | None


@dataclass(frozen=True)
class AnalogInput:
    """A voltage at a pin of the chip's ADC1.

    Attributes:
        number: Number in the input's name: 1 is `analog_1`.
        pin: GPIO of the input.
        divider: Volts at the input per volt at the pin.
    """

    kind: ClassVar[PeripheralKind] = PeripheralKind.ANALOG
    place: ClassVar[Place] = Place.NONE

    number: int
    pin: int | None
    divider: float = 1.0


Peripheral: TypeAlias = (
    ImuSensor | PowerSensor | BatteryLevels | DigitalInput | RangeSensor | AnalogInput
)


def axis_name(axis: Axis) -> str:
    """The name of an axis in a board's file: `x`, `-x`."""
    return axis.name.lower().replace("minus_", "-")


def most_bias_radps(chip: SensorChip) -> float:
    """The largest bias that an entry can hold, in rad/s."""
    return (_HALF - 1) * IMUS[chip].gyro_radps


def key_of(entry: Peripheral) -> str:
    """The section of a board's file that names this entry."""
    if isinstance(entry, DigitalInput):
        return f"inputs.{channel_name(entry.kind, entry.place).replace('.', '_')}"
    if isinstance(entry, AnalogInput):
        return f"inputs.{channel_name(entry.kind, entry.place, entry.number)}"
    if isinstance(entry, RangeSensor):
        return f"ranges.{entry.place.name.lower()}"
    return "imu" if isinstance(entry, ImuSensor) else "power"


def packed_entry(entry: Peripheral) -> bytes:
    """The bytes of an entry, on the line and in flash.

    Raises:
        ConfigurationError: A value does not fit into its field.
    """
    values: dict[str, int] = dict.fromkeys(_ENTRY_FIELDS, 0)
    values |= {"kind": entry.kind, "place": entry.place}
    pins: tuple[int | None, ...] = ()
    if isinstance(entry, (ImuSensor, PowerSensor)):
        values |= {"chip": entry.chip, "address": entry.address or 0}
        if entry.bus is None and entry.sda is not None and entry.scl is None:
            # A packed entry with one pin means a bus by its number.
            raise ConfigurationError(f"{key_of(entry)}.scl is missing: name it, or the bus")
        pins = (entry.sda, entry.scl) if entry.bus is None else (entry.bus, None)
    if isinstance(entry, ImuSensor):
        values |= {"forward": entry.forward, "up": entry.up}
        values |= zip(_VALUES, _counts_of(entry), strict=True)
        pins = *pins, entry.interrupt
    elif isinstance(entry, PowerSensor):
        values["value_a"] = _whole(entry.shunt_mohm * 10)
    elif isinstance(entry, BatteryLevels):
        levels = entry.warn_v, entry.limit_v, entry.stop_v
        values |= zip(_VALUES, (_whole(volts * 1000) for volts in levels), strict=True)
    elif isinstance(entry, RangeSensor):
        values["chip"] = entry.chip
        pins = entry.trigger, entry.echo
    elif isinstance(entry, AnalogInput):
        values |= {"value_a": _whole(entry.divider * 1000), "value_b": entry.number}
        pins = (entry.pin,)
    else:
        triggered_low = PeripheralFlag.TRIGGERED_LOW if entry.triggered_low else 0
        values["flags"] = triggered_low | _PULL_FLAGS[entry.pull]
        pins = (entry.pin,)
    # Pins left out are not connected.
    for name, pin in zip(_PINS, (*pins, None, None, None), strict=False):
        values[name] = NO_PIN if pin is None else pin
    try:
        return ENTRY.pack(*(values[name] for name in _ENTRY_FIELDS))
    except struct.error as error:
        raise ConfigurationError(f"{key_of(entry)} cannot be packed: {error}") from error


def unpacked_entry(data: bytes) -> Peripheral:
    """The peripheral in a packed entry.

    Raises:
        ConfigurationError: This release does not know a code in it.
    """
    values = dict(zip(_ENTRY_FIELDS, ENTRY.unpack(data), strict=True))
    first, second, third = (None if values[name] == NO_PIN else values[name] for name in _PINS)
    numbers = [values[name] for name in _VALUES]
    address = values["address"] or None
    # The firmware refuses a bus with only one of its two pins, so a single number is a bus number.
    bus = first if second is None else None
    sda, scl = (first, second) if bus is None else (None, None)
    try:
        kind, chip = PeripheralKind(values["kind"]), SensorChip(values["chip"])
        forward, up = Axis(values["forward"]), Axis(values["up"])
        place, flags = Place(values["place"]), PeripheralFlag(values["flags"])
    except ValueError as error:
        # One of the enumerations raised it: a newer release has more chips or kinds.
        raise ConfigurationError(
            f"the robot has a peripheral that this release does not know ({error}): "
            "update wheelwire"
        ) from None
    if kind is PeripheralKind.IMU:
        bias = _bias_of(chip, numbers)
        return ImuSensor(chip, sda, scl, third, forward, up, address, bias, bus)
    if kind is PeripheralKind.POWER:
        return PowerSensor(chip, sda, scl, numbers[0] / 10, address, bus)
    if kind is PeripheralKind.BATTERY:
        return BatteryLevels(*(millivolts / 1000 for millivolts in numbers))
    if kind is PeripheralKind.RANGE:
        return RangeSensor(chip, place, first, second)
    if kind is PeripheralKind.ANALOG:
        return AnalogInput(numbers[1], first, numbers[0] / 1000)
    is_low = PeripheralFlag.TRIGGERED_LOW in flags
    # EXTERNAL, which has no flag, is the last of them.
    pull = next(pull for pull, flag in _PULL_FLAGS.items() if flag in flags)
    return DigitalInput(kind, place, first, is_low, pull)


def silent_wires(entries: Sequence[Peripheral]) -> list[str]:
    """The digital inputs that a broken wire makes look safe for ever, a sentence each."""
    held = {Pull.INTERNAL: ("high", False), Pull.DOWN: ("low", True)}
    found = []
    for entry in entries:
        if not isinstance(entry, DigitalInput):
            continue
        name = channel_name(entry.kind, entry.place)
        if entry.pull not in held:
            found.append(
                f"{name}: the board's own resistors decide what a broken wire reads as: pull the "
                "wire off, and see that the robot stops"
            )
            continue
        level, triggers = held[entry.pull]
        if triggers != entry.triggered_low:
            found.append(
                f"{name}: a broken wire reads as {level}, which stops nothing: choose a sensor and "
                "a `pull` for which it does, or pull the wire off now and then to try it"
            )
    return found


def peripheral_sentence(issue: PeripheralIssue, entries: Sequence[Peripheral]) -> str:
    """The sentence for a person: what is wrong, and what to do."""
    return issue.fault.doc.format(
        entry=key_of(entries[issue.channel]) if issue.channel >= 0 else "",
        pin=issue.pin,
        value=issue.value,
        limit=issue.limit,
    )


def _whole(value: float) -> int:
    """The nearest whole number; for infinity and NaN one that fits into no field."""
    return round(value) if math.isfinite(value) else -1


def _counts_of(imu: ImuSensor) -> list[int]:
    if not any(imu.bias):
        return [0, 0, 0]
    if imu.chip not in IMUS:
        raise ConfigurationError(f"imu.chip = {imu.chip.name}: it has no gyroscope")
    per_count = IMUS[imu.chip].gyro_radps
    # The comparison is false for NaN, too.
    if len(imu.bias) != len(_VALUES) or not all(
        -_HALF - 0.5 <= radps / per_count < _HALF - 0.5 for radps in imu.bias
    ):
        most = most_bias_radps(imu.chip)
        raise ConfigurationError(f"imu.bias = {imu.bias}: choose {-most:.2f} to {most:.2f} rad/s")
    return [round(radps / per_count) % _COUNTS for radps in imu.bias]


def _bias_of(chip: SensorChip, numbers: Sequence[int]) -> tuple[float, float, float]:
    table = IMUS.get(chip)
    if table is None:
        return (0.0, 0.0, 0.0)
    signed = [n - _COUNTS if n >= _HALF else n for n in numbers]
    x, y, z = (round(count * table.gyro_radps, _BIAS_DIGITS) for count in signed)
    return (x, y, z)


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
            return BOARD.pack(*(values[name] for name in _BOARD_FIELDS))
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


def unpacked(data: bytes) -> Configuration:
    """The configuration in its packed form.

    Raises:
        ConfigurationError: It is damaged, or of a version or with codes that are unknown here.
    """
    # Before anything is read: in damaged bytes even the version means nothing.
    body, crc = data[:-_CRC_SIZE], data[-_CRC_SIZE:]
    if len(data) != _PACKED_SIZE or zlib.crc32(body) != int.from_bytes(crc, "little"):
        raise ConfigurationError(f"the board cannot be read: {BoardFault.DAMAGED.doc}")
    values = dict(zip(_BOARD_FIELDS, BOARD.unpack_from(body), strict=True))
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
