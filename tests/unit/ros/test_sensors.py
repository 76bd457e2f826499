"""What the sensors keep the robot from, and where bumpers are, without a node."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus

from wheelwire import (
    BatteryLevel,
    InputReading,
    InputsSample,
    PowerSample,
    RangeSample,
    Reflex,
    SensorInfo,
    SensorState,
    SensorStatus,
)
from wheelwire.log.ros_messages import obstacles
from wheelwire_protocol.codes import PeripheralKind, Place, channel_name
from wheelwire_protocol.peripherals import SensorChip
from wheelwire_ros.sensors import Limits, channel_words, limits_of

BUMPER, CLIFF, STAGE = PeripheralKind.BUMPER, PeripheralKind.CLIFF, PeripheralKind.STAGE_FAULT


def info(
    kind: PeripheralKind, place: Place = Place.NONE, channel: int = 0, number: int = 0
) -> SensorInfo:
    name = channel_name(kind, place, number)
    return SensorInfo(channel, name, kind, SensorChip.NONE, place, 0, 0.0, 0.0)


def inputs(*infos: SensorInfo, triggered: bool = True, reflexes: int = 0) -> InputsSample:
    reading = InputReading(triggered, level=triggered, edges=3, state=SensorState.OK)
    channels = {one.name: reading for one in infos}
    return InputsSample(5, channels, Reflex(reflexes), BatteryLevel.UNKNOWN, 1.0, 0.001)


def status(
    one: SensorInfo,
    sample: InputsSample | PowerSample | RangeSample | None = None,
    state: SensorState = SensorState.OK,
) -> SensorStatus:
    return SensorStatus(one, state, None if sample is None else 0.01, sample)


@pytest.mark.parametrize(
    ("kind", "place", "reflex", "words"),
    [
        (BUMPER, Place.FRONT, Reflex.NO_FORWARD, "bumper.front triggered: the robot only backs"),
        (BUMPER, Place.REAR_LEFT, Reflex.NO_REVERSE, "bumper.rear_left triggered: the robot only"),
        (CLIFF, Place.FRONT, Reflex.STOP, "cliff.front triggered: the robot stops"),
        (STAGE, Place.NONE, Reflex.STOP, "stage_fault triggered: the robot stops"),
    ],
)
def test_a_triggered_input_says_what_it_does(
    kind: PeripheralKind, place: Place, reflex: Reflex, words: str
) -> None:
    one = info(kind, place)
    sample = inputs(one, reflexes=reflex)
    limits = limits_of([status(one, sample)], sample)
    assert (limits.triggered, limits.reflexes) == ((one.name,), (reflex.name,))
    assert limits.sentences[0].startswith(words)
    level, message, values = channel_words(status(one, sample))
    assert level == DiagnosticStatus.WARN
    assert message == limits.sentences[0]
    assert (values["state"], values["triggered"], values["edges"]) == ("OK", True, 3)


def test_free_and_healthy_sensors_limit_nothing() -> None:
    one = info(BUMPER, Place.FRONT)
    sample = inputs(one, triggered=False)
    assert limits_of([status(one, sample)], sample) == Limits()
    assert channel_words(status(one, sample))[:2] == (DiagnosticStatus.OK, "OK")


@pytest.mark.parametrize(
    ("state", "is_told"),
    [(SensorState.ABSENT, True), (SensorState.ZERO, True), (SensorState.MISSED, False)],
)
def test_a_stale_sensor_is_reported_unless_it_may_pass(state: SensorState, is_told: bool) -> None:
    stale = status(info(PeripheralKind.IMU), state=state)
    assert bool(limits_of([stale], None).sentences) is is_told
    level, message, values = channel_words(stale)
    assert level == DiagnosticStatus.STALE
    assert message.startswith(f"STALE, {state.name}")
    assert (values["state"], values["reason"]) == ("STALE", state.name)
    assert math.isnan(values["age_s"])


@pytest.mark.parametrize(
    ("level", "words"),
    [
        (BatteryLevel.UNKNOWN, ""),
        (BatteryLevel.OK, ""),
        (BatteryLevel.LIMIT, "at half its speed"),
        (BatteryLevel.STOP, "stops until the battery is charged"),
    ],
)
def test_an_empty_battery_is_reported(level: BatteryLevel, words: str) -> None:
    battery = info(PeripheralKind.BATTERY)
    sample = PowerSample(5, 6.5, None, None, level, 1.0, 0.001)
    sentences = limits_of([status(battery, sample)], None).sentences
    assert words in " ".join(sentences)
    assert len(sentences) == bool(words)
    assert channel_words(status(battery, sample))[2]["voltage_v"] == 6.5


@pytest.mark.parametrize(
    ("place", "degrees"),
    [
        *((Place.FRONT, 0), (Place.FRONT_LEFT, 45), (Place.REAR, 180), (Place.REAR_RIGHT, -135)),
        *((Place.LEFT, 90), (Place.RIGHT, -90)),
    ],
)
def test_a_point_lies_where_the_bumper_is(place: Place, degrees: float) -> None:
    one = info(CLIFF, place)
    ((x_m, y_m, z_m),) = obstacles([one], inputs(one), 0.3, 0.04)
    assert math.degrees(math.atan2(y_m, x_m)) == pytest.approx(degrees)
    assert (math.hypot(x_m, y_m), z_m) == pytest.approx((0.3, 0.04))


def test_a_range_limits_nothing() -> None:
    sample = RangeSample(5, 1, "front", -math.inf, 0.02, 4.0, 0.26, 1.0, 0.001)
    one = status(info(PeripheralKind.RANGE, Place.FRONT), sample)
    assert limits_of([one], None) == Limits()
    level, message, values = channel_words(one)
    assert (level, message, values["distance_m"]) == (DiagnosticStatus.OK, "OK", -math.inf)


def test_a_voltage_is_in_the_words_of_its_channel() -> None:
    one = info(PeripheralKind.ANALOG, number=2)
    sample = inputs()._replace(analog={"analog_2": 3.3})
    assert limits_of([status(one, sample)], sample) == Limits()
    level, message, values = channel_words(status(one, sample))
    assert (level, message, values["voltage_v"]) == (DiagnosticStatus.OK, "OK", 3.3)
    assert "triggered" not in values


def test_only_triggered_bumpers_and_cliffs_are_obstacles() -> None:
    free, stage = info(BUMPER, Place.FRONT), info(STAGE)
    unknown = info(CLIFF, Place.FRONT)
    assert obstacles([free], inputs(free, triggered=False), 0.3, 0.0) == []
    assert obstacles([stage, unknown], inputs(stage), 0.3, 0.0) == []
