"""What a robot reports: samples of wheels, sensors and inputs, and the events of its sensors."""

from __future__ import annotations

import dataclasses
import enum
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from wheelwire_protocol.codes import (
    BatteryLevel,
    Fault,
    PeripheralKind,
    Place,
    Reflex,
    SensorEventCode,
    SensorState,
    SupervisorState,
)

if TYPE_CHECKING:
    from wheelwire_protocol.peripherals import SensorChip

TICK_MODULUS = 1 << 32
IMU, POWER, INPUTS, RANGE, EVENTS = "imu", "power", "inputs", "ranges", "events"
"""What a robot's sensors pass on; INPUTS: all of them together."""

Vector = tuple[float, float, float]
"""x forward, y left, z up."""


def tick_difference(later: int, earlier: int) -> int:
    """Signed difference of two 32-bit counters, exact while it is below 2^31."""
    # Shifted by half the range and back, the remainder lies in -2^31 to 2^31 - 1.
    half = TICK_MODULUS // 2
    return (later - earlier + half) % TICK_MODULUS - half


class Setpoint(NamedTuple):
    """What a program asked of the wheels."""

    left: float
    """m/s, or with `duty` a duty, -1..1."""
    right: float
    duty: bool


class WheelTravel(NamedTuple):
    """The travel of both wheels from one sample to a later one."""

    left: int
    """Ticks, forward positive."""
    right: int
    """Ticks, forward positive."""
    dt_s: float
    """Time between the samples on the device's clock."""
    rebased: bool
    """Whether the device was reset in between: the travel is unknown then, and given as 0."""


class WheelSample(NamedTuple):
    """Both encoders, latched by the device at one instant.

    Attributes:
        boot_id: Random number drawn by the device at each reset.
        t_us: The device's clock at the latch, 64 bits. [us]
        left_ticks: Cumulative, as on the wire: wraps at 2^32.
        right_ticks: Cumulative, as on the wire: wraps at 2^32.
        left_mps: Measured at the rim. [m/s]
        right_mps: Measured at the rim. [m/s]
        left_duty: On the output, -1..1; 0 when not driving.
        right_duty: On the output, -1..1; 0 when not driving.
        command_seq: Number of the setpoint obeyed now, or the last one obeyed.
        state: State of the supervisor.
        faults: Latched faults.
        overruns: Control steps that were late, since the reset. Wraps at 2^16.
        battery_v: None if the device does not measure it. [V]
        stamp: Time of the latch on this host's `time.monotonic()`. [s]
        stamp_error_s: Error bound of the stamp. [s]
    """

    boot_id: int
    t_us: int
    left_ticks: int
    right_ticks: int
    left_mps: float
    right_mps: float
    left_duty: float
    right_duty: float
    command_seq: int
    state: SupervisorState
    faults: Fault
    overruns: int
    battery_v: float | None
    stamp: float
    stamp_error_s: float

    def since(self, earlier: WheelSample) -> WheelTravel:
        """The travel from `earlier` to this sample, correct across counter wraps."""
        # A reset sets the counters back: across it their difference means nothing.
        if self.boot_id != earlier.boot_id:
            return WheelTravel(0, 0, 0.0, rebased=True)
        return WheelTravel(
            tick_difference(self.left_ticks, earlier.left_ticks),
            tick_difference(self.right_ticks, earlier.right_ticks),
            (self.t_us - earlier.t_us) / 1e6,
            rebased=False,
        )


class ImuSample(NamedTuple):
    """One sample of the gyroscope and the accelerometer, in the robot's axes (REP-103).

    Attributes:
        t_us: The device's clock at the measurement, 64 bits. [us]
        sample: Number of the chip's sample. Wraps at 2^16.
        gyro: Angular velocity about each axis, less the bias in the board's file. [rad/s]
        acceleration: Acceleration along each axis; a robot at rest has 9.8 upwards. [m/s^2]
        temperature_c: Temperature of the chip. [degC]
        stamp: Time of the measurement on this host's `time.monotonic()`. [s]
        stamp_error_s: Error bound of the stamp. [s]
    """

    t_us: int
    sample: int
    gyro: Vector
    acceleration: Vector
    temperature_c: float
    stamp: float
    stamp_error_s: float


class PowerSample(NamedTuple):
    """One sample of the supply, by a power sensor or by the board's battery divider.

    Attributes:
        t_us: The device's clock at the measurement, 64 bits. [us]
        voltage_v: Voltage of the supply. [V]
        current_a: Current drawn; None if nothing measures it. [A]
        used_ah: Charge drawn since the device started; None if nothing measures it. [Ah]
        level: Level of the battery, by the voltages in the board's file.
        stamp: Time of the measurement on this host's `time.monotonic()`. [s]
        stamp_error_s: Error bound of the stamp. [s]
    """

    t_us: int
    voltage_v: float
    current_a: float | None
    used_ah: float | None
    level: BatteryLevel
    stamp: float
    stamp_error_s: float


class RangeSample(NamedTuple):
    """One measurement of a range sensor.

    Attributes:
        t_us: The device's clock at the middle of the echo, 64 bits. [us]
        sample: Number of the sensor's measurement. Wraps at 2^16.
        name: Place of the sensor, as in the board's file: `front`.
        distance_m: Distance to the nearest object in the sensor's cone. As in REP-117: infinite if
            nothing is within reach, minus infinite if an object is too near to measure. [m]
        min_m: Shortest distance that the sensor measures. [m]
        max_m: Longest distance that the sensor measures. [m]
        field_of_view_rad: Full width of the sensor's cone. [rad]
        stamp: Time of the measurement on this host's `time.monotonic()`. [s]
        stamp_error_s: Error bound of the stamp. [s]
    """

    t_us: int
    sample: int
    name: str
    distance_m: float
    min_m: float
    max_m: float
    field_of_view_rad: float
    stamp: float
    stamp_error_s: float


class InputReading(NamedTuple):
    """One digital input.

    Attributes:
        triggered: Whether a bumper is pressed, a cliff is seen, or a power stage has tripped.
        level: Level at the pin; True: high.
        edges: Number of the level's changes since the device's reset. Wraps at 2^16.
        state: Whether the input can be used.
    """

    triggered: bool
    level: bool
    edges: int
    state: SensorState


class InputsSample(NamedTuple):
    """All inputs at one moment, and what the sensors forbid.

    Attributes:
        t_us: The device's clock at the reading, 64 bits. [us]
        channels: Each digital input by its name, such as `bumper.front_left`.
        reflexes: What the sensors forbid now, whatever is commanded.
        level: Level of the battery.
        stamp: Time of the reading on this host's `time.monotonic()`. [s]
        stamp_error_s: Error bound of the stamp. [s]
        analog: Voltage before the divider of each analogue input that can be used, by its name,
            such as `analog_1`. [V]
    """

    t_us: int
    channels: Mapping[str, InputReading]
    reflexes: Reflex
    level: BatteryLevel
    stamp: float
    stamp_error_s: float
    analog: Mapping[str, float] = MappingProxyType({})

    @property
    def triggered(self) -> tuple[str, ...]:
        """The names of the inputs that act on the robot."""
        return tuple(name for name, one in self.channels.items() if one.triggered)


class SensorInfo(NamedTuple):
    """Description of a channel.

    Attributes:
        channel: Number of the channel: its index in the board's list of peripherals.
        name: Such as `imu`, `battery`, `bumper.front_left`, `range.front`, `analog_1`.
        kind: What is connected.
        chip: The sensor's chip; NONE without one.
        place: Place on the robot.
        rate_hz: Rate of the samples; 0: one on each change, and one each second. [Hz]
        gyro_noise: Standard deviation of an IMU's gyroscope. [rad/s]
        acceleration_noise: Standard deviation of an IMU's accelerometer. [m/s^2]
    """

    channel: int
    name: str
    kind: PeripheralKind
    chip: SensorChip
    place: Place
    rate_hz: int
    gyro_noise: float
    acceleration_noise: float


class SensorEvent(NamedTuple):
    """Something happened to a channel, or its reflex acted.

    Attributes:
        name: Name of the channel.
        code: What happened.
        value: A SensorState, a Reflex, a BatteryLevel or a rate, depending on the code.
        sentence: The event in words.
        t_us: The device's clock at the event, 64 bits. [us]
        stamp: Time of the event on this host's `time.monotonic()`. [s]
        stamp_error_s: Error bound of the stamp. [s]
    """

    name: str
    code: SensorEventCode
    value: int
    sentence: str
    t_us: int
    stamp: float
    stamp_error_s: float

    @property
    def is_warning(self) -> bool:
        """Whether the event limits the robot, or needs its user's attention."""
        if self.code is SensorEventCode.STATE:
            return self.value != SensorState.OK
        if self.code is SensorEventCode.BATTERY:
            return self.value not in (BatteryLevel.UNKNOWN, BatteryLevel.OK)
        return self.code is not SensorEventCode.RELEASED


_EFFECTS = {
    Reflex.NO_FORWARD: "the robot only backs out",
    Reflex.NO_REVERSE: "the robot only drives forward",
    Reflex.STOP: "the robot stops",
}
_LEVELS = {
    BatteryLevel.UNKNOWN: "the charge is unknown",
    BatteryLevel.OK: "charged",
    BatteryLevel.WARN: "low; charge it soon",
    BatteryLevel.LIMIT: "low; the robot drives at half its speed at most",
    BatteryLevel.STOP: "empty; the robot stops until the battery is charged",
}


# By the content of their identity register, from the data sheets: modules have other names.
_OTHER_CHIPS = {
    0x11: "ICM-20600",
    0x12: "ICM-20602",
    0x19: "MPU-6886",
    0x42: "ICM-42605",
    0x47: "ICM-42688-P",
    0x6B: "LSM6DSR",
    0x6C: "LSM6DSO",
    0xAE: "ICM-20608-D",
    0xAF: "ICM-20608-G",
}


def sentence_of_identity(identity: int) -> str:
    """What another chip in a sensor's place says it is, and what to do."""
    if name := _OTHER_CHIPS.get(identity):
        return (
            f"another chip answers in its place: {identity:#04x}, as of an {name}, "
            "which Wheelwire cannot read; use a module with one of the chips in docs/sensors.md"
        )
    return (
        f"another chip answers in its place: {identity:#04x}, which Wheelwire does not know; look "
        "at the bus for a device of the same address, and at `chip` in the board's file"
    )


def sentence_of_event(name: str, code: SensorEventCode, value: int) -> str:
    """An event in words.

    Raises:
        ValueError: The code has no such value.
    """
    if code is SensorEventCode.STATE:
        return f"{name}: {sentence_of_state(SensorState(value))}"
    if code is SensorEventCode.TRIGGERED:
        return f"{name} triggered: {_EFFECTS.get(Reflex(value), 'the robot is limited')}"
    if code is SensorEventCode.RELEASED:
        return f"{name} is free again"
    if code is SensorEventCode.BATTERY:
        return f"{name}: {_LEVELS[BatteryLevel(value)]}"
    if code is SensorEventCode.IDENTITY:
        return f"{name}: {sentence_of_identity(value)}"
    return f"{name}: the line carries only {value} samples a second"


def sentence_of_state(state: SensorState, identity: int = 0) -> str:
    """A sensor's state in words; `identity`: what another chip in its place says it is."""
    if state is SensorState.ABSENT and identity:
        return f"STALE, ABSENT: {sentence_of_identity(identity)}"
    if state is SensorState.OK:
        return "OK"
    return f"STALE, {state.name}: {state.doc[0].lower()}{state.doc[1:].rstrip('.')}"


def asdict(reported: object) -> dict[str, Any]:
    """A sample, health, an event, or anything else that a robot reports, as JSON can hold it.

    A code is its name, flags are a list of their names, and NaN and infinity are None.

    Raises:
        TypeError: It has no fields with names.
    """
    found = to_json_value(reported)
    if not isinstance(found, dict):
        raise TypeError(f"{type(reported).__name__} has no fields: give what a robot reports")
    return cast("dict[str, Any]", found)


def to_json_value(value: Any) -> Any:
    """A value as JSON has it: a code is its name, flags are a list of names, NaN is null."""
    # Before the other enumerations: a combination of flags has no single name.
    if isinstance(value, enum.Flag):
        return [member.name for member in type(value) if member in value]
    if isinstance(value, enum.Enum):
        return value.name
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_json_value(getattr(value, f.name)) for f in dataclasses.fields(value)}
    # Before the sequences: a named tuple is one, too, but its names are worth keeping.
    if hasattr(value, "_asdict"):
        return {key: to_json_value(item) for key, item in value._asdict().items()}
    if isinstance(value, Mapping):
        return {str(key): to_json_value(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json_value(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
