"""Sensors, inputs and reflexes: what a device says of them. `peripherals` has what a board says."""

from __future__ import annotations

from .codes import DocumentedEnum, DocumentedFlag

MOST_PERIPHERALS = 10
"""Entries of a list. A channel is the index of an entry."""


class PeripheralKind(DocumentedEnum):
    """What is connected, and what the firmware does with it."""

    NONE = 0, "Nothing; the end of the list."
    IMU = 1, "Gyroscope and accelerometer on an I2C bus."
    POWER = 2, "Voltage and current of the supply, by a chip on an I2C bus."
    BATTERY = 3, "Levels of the battery at which the robot warns, slows down and stops."
    BUMPER = 4, "A normally closed switch to ground: no driving towards it while it is open."
    CLIFF = 5, "A digital sensor that sees no floor: the robot stops."
    STAGE_FAULT = 6, "The fault output of a power stage, low when it has tripped: the robot stops."
    RANGE = 7, "Distance to what is ahead, by the echo of a sound."
    ANALOG = 8, "A voltage at a pin of ADC1, by a divider."


class Place(DocumentedEnum):
    """Where on the robot it is."""

    NONE = 0, "Nowhere in particular."
    FRONT = 1, "At the front."
    FRONT_LEFT = 2, "At the front, left."
    FRONT_RIGHT = 3, "At the front, right."
    REAR = 4, "At the rear."
    REAR_LEFT = 5, "At the rear, left."
    REAR_RIGHT = 6, "At the rear, right."
    LEFT = 7, "At the left side."
    RIGHT = 8, "At the right side."


FRONT_PLACES = (Place.FRONT, Place.FRONT_LEFT, Place.FRONT_RIGHT)
REAR_PLACES = (Place.REAR, Place.REAR_LEFT, Place.REAR_RIGHT)


class SensorState(DocumentedEnum):
    """Whether a sensor's samples can be used. Only OK ones are sent."""

    UNREAD = 0, "Not read since the start."
    OK = 1, "Its newest sample is fresh."
    ABSENT = 2, "It does not answer, or another chip does."
    HUNG = 3, "Its bus is stuck: a line is held low, or a transfer does not end."
    RESET = 4, "It has lost its settings, as after a dip of its supply; it is set up again."
    MISSED = 5, "No new sample came within two periods."
    FROZEN = 6, "It repeats one raw sample: the chip no longer measures."
    ZERO = 7, "A divider reads 0 mV, as with a broken wire."


class RangeQuality(DocumentedEnum):
    """What a range sensor's echo says."""

    GOOD = 0, "Something is at this distance."
    FAR = 1, "No echo: nothing is within the sensor's reach."
    NEAR = 2, "Something is nearer than the sensor can measure."


class BatteryLevel(DocumentedEnum):
    """How full the battery is, by the levels of its entry."""

    UNKNOWN = 0, "Not judged: there is no entry for it, or no measurement yet."
    OK = 1, "Above the level of the warning."
    WARN = 2, "Below the level of the warning."
    LIMIT = 3, "Below the level at which the robot slows down to half its speed."
    STOP = 4, "Below the level at which it stops, until it is charged."


class SensorEventCode(DocumentedEnum):
    """What a SensorEvent reports."""

    STATE = 0, "The sensor's state changed; `value` is the SensorState."
    TRIGGERED = 1, "The input triggered; `value` is what its reflex does."
    RELEASED = 2, "The input is free again; `value` is what its reflex did."
    BATTERY = 3, "The battery's level changed; `value` is the BatteryLevel."
    REDUCED = 4, "The line is too slow for the rate asked for; `value` is the rate [Hz]."
    IDENTITY = 5, "Another chip answers in its place; `value` is what it says it is."


class Reflex(DocumentedFlag):
    """What the sensors forbid now, whatever the host commands."""

    NO_FORWARD = 1, "A front bumper: the robot may only back out."
    NO_REVERSE = 2, "A rear bumper: the robot may only drive forward."
    STOP = 4, "A cliff, a power stage or the battery: nothing drives; EXTERNAL."
    LIMIT = 8, "The battery is low: half of the speed at most."
    UNREAD = 16, "A sensor that can stop the robot was not read since the start."


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
