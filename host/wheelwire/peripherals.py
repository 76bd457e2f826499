"""A board's peripherals: sensors, inputs and the battery's levels, and whether they can work.

Peripherals are a part of the configuration (`board`). Its YAML file names them (`files.board`); on
the line and in flash they are packed entries, which the firmware's own rules check. The index of an
entry is its channel.
"""

from __future__ import annotations

import enum
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

from wheelwire_protocol.board import NO_PIN
from wheelwire_protocol.native import PeripheralIssue
from wheelwire_protocol.sensors import (
    IMUS,
    Axis,
    PeripheralFlag,
    PeripheralKind,
    Place,
    SensorChip,
)
from wheelwire_protocol.types import PERIPHERAL_LAYOUT

from .errors import ConfigurationError

# Little-endian and without padding, as on the wire.
ENTRY = struct.Struct("<" + "".join(letters for _, letters in PERIPHERAL_LAYOUT))
_NAMES = [name for name, _ in PERIPHERAL_LAYOUT]
_PINS = ("pin_a", "pin_b", "pin_c")
_VALUES = ("value_a", "value_b", "value_c")
EMPTY_ENTRY = ENTRY.pack(*(NO_PIN if name in _PINS else 0 for name in _NAMES))
"""An entry that does not count."""
# An entry has unsigned numbers only; a bias is in two's complement.
_HALF, _COUNTS = 0x8000, 0x1_0000
_BIAS_DIGITS = 5
"""Decimals of a bias in rad/s: enough for one count of any chip."""


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

DIGITAL_INPUTS = (PeripheralKind.BUMPER, PeripheralKind.CLIFF, PeripheralKind.STAGE_FAULT)
INPUTS = (*DIGITAL_INPUTS, PeripheralKind.ANALOG)
"""The kinds that share one sample."""


def channel_name(kind: PeripheralKind, place: Place, number: int = 0) -> str:
    """What users call a channel: `imu`, `bumper.front_left`, `range.front`, `analog_1`.

    Args:
        kind: What is connected.
        place: Place on the robot.
        number: Number of an analogue input.
    """
    name = kind.name.lower()
    if kind is PeripheralKind.ANALOG:
        return f"{name}_{number}"
    return name if place is Place.NONE else f"{name}.{place.name.lower()}"


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
    values: dict[str, int] = dict.fromkeys(_NAMES, 0)
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
    # Those that are left out are not connected.
    for name, pin in zip(_PINS, (*pins, None, None, None), strict=False):
        values[name] = NO_PIN if pin is None else pin
    try:
        return ENTRY.pack(*(values[name] for name in _NAMES))
    except struct.error as error:
        raise ConfigurationError(f"{key_of(entry)} cannot be packed: {error}") from error


def unpacked_entry(data: bytes) -> Peripheral:
    """The peripheral in a packed entry.

    Raises:
        ConfigurationError: This release does not know a code in it.
    """
    values = dict(zip(_NAMES, ENTRY.unpack(data), strict=True))
    first, second, third = (None if values[name] == NO_PIN else values[name] for name in _PINS)
    numbers = [values[name] for name in _VALUES]
    address = values["address"] or None
    # The firmware refuses a bus with one of its two pins: a single number is that of a bus.
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
