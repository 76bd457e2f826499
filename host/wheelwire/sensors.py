"""Samples of a robot's sensors and inputs, and what happens to them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from wheelwire_protocol.sensors import (
    BatteryLevel,
    PeripheralKind,
    Place,
    Reflex,
    SensorChip,
    SensorEventCode,
    SensorState,
)

Vector = tuple[float, float, float]
"""x forward, y left, z up."""


class ImuSample(NamedTuple):
    """One sample of the gyroscope and the accelerometer, in the robot's axes (REP-103).

    Attributes:
        t_us: The device's clock when it was measured, 64 bits. [us]
        sample: Counts the samples that the chip gave. Wraps at 2^16.
        gyro: Turning about each axis, without the bias that the board's file names. [rad/s]
        acceleration: Along each axis; at rest 9.8 upwards. [m/s^2]
        temperature_c: Of the chip. [degC]
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
    """The supply: of a power sensor, or of the board's battery divider.

    Attributes:
        t_us: The device's clock when it was measured, 64 bits. [us]
        voltage_v: Measured. [V]
        current_a: Drawn; None if nothing measures it. [A]
        used_ah: Drawn since the device started; None if nothing measures it. [Ah]
        level: Of the battery, by the levels of its board.
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
        sample: Counts the sensor's measurements. Wraps at 2^16.
        name: Where it is on the robot, as in the board's file: `front`.
        distance_m: To the nearest thing in its cone. As in REP-117: infinite if nothing is within
            reach, minus infinite if something is nearer than it can measure. [m]
        min_m: What is nearer is not measured. [m]
        max_m: What is farther is not measured. [m]
        field_of_view_rad: Full width of the cone in which it sees something. [rad]
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
        triggered: It acts on the robot: a bumper is pressed, a cliff is seen, a stage has tripped.
        level: At its pin; True: high.
        edges: Of the level, since the device's reset. Wraps at 2^16.
        state: Whether it can be used.
    """

    triggered: bool
    level: bool
    edges: int
    state: SensorState


class InputsSample(NamedTuple):
    """All inputs at one moment, and what the sensors forbid.

    Attributes:
        t_us: The device's clock when they were read, 64 bits. [us]
        channels: Each digital input by its name, as in `bumper.front_left`.
        reflexes: What is forbidden now, whatever is commanded.
        level: Of the battery.
        stamp: Time of the reading on this host's `time.monotonic()`. [s]
        stamp_error_s: Error bound of the stamp. [s]
        analog: Each analogue input that can be used by its name, as in `analog_1`: the voltage
            before its divider. [V]
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
    """What a channel is.

    Attributes:
        channel: Its number: the place in the board's list of peripherals.
        name: As in `imu`, `battery`, `bumper.front_left`, `range.front`, `analog_1`.
        kind: What is connected.
        chip: Which chip; NONE if it is none.
        place: Where it is on the robot.
        rate_hz: At which samples come; 0: on a change, and each second. [Hz]
        gyro_noise: Of an IMU: standard deviation. [rad/s]
        acceleration_noise: Of an IMU: standard deviation. [m/s^2]
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
        name: Of the channel.
        code: What.
        value: By code: a SensorState, what a Reflex does, a BatteryLevel, or a rate.
        sentence: The same for people.
        t_us: The device's clock, 64 bits. [us]
        stamp: On this host's `time.monotonic()`. [s]
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
        """Whether the robot, or its user, is limited by it."""
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
    BatteryLevel.UNKNOWN: "its level is unknown",
    BatteryLevel.OK: "it is charged",
    BatteryLevel.WARN: "it is low: charge it soon",
    BatteryLevel.LIMIT: "it is low: the robot drives at half its speed at most",
    BatteryLevel.STOP: "it is empty: the robot stops until it is charged",
}


def sentence_of_event(name: str, code: SensorEventCode, value: int) -> str:
    """What has happened, for people.

    Raises:
        ValueError: The value means nothing for this code.
    """
    if code is SensorEventCode.STATE:
        return f"{name}: {sentence_of_state(SensorState(value))}"
    if code is SensorEventCode.TRIGGERED:
        return f"{name} triggered: {_EFFECTS.get(Reflex(value), 'the robot is limited')}"
    if code is SensorEventCode.RELEASED:
        return f"{name} is free again"
    if code is SensorEventCode.BATTERY:
        return f"{name}: {_LEVELS[BatteryLevel(value)]}"
    return f"{name}: the line carries {value} samples a second, no more"


def sentence_of_state(state: SensorState) -> str:
    """Whether a sensor's samples can be used, for people."""
    if state is SensorState.OK:
        return "OK"
    return f"STALE, {state.name}: {state.doc[0].lower()}{state.doc[1:].rstrip('.')}"
