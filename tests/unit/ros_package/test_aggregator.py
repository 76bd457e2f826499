"""The file for diagnostic_aggregator: each status at one place, and no alarm without a reason."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from support.aggregator import ERROR, OK, STALE, WARN, Aggregator
from support.cases import each

FILE = Path(__file__).parents[3] / "ros_node" / "config" / "diagnostics_aggregator.yaml"
ALWAYS = ("link", "robot", "commands")
PLACES = {
    **dict.fromkeys(ALWAYS, "Drive"),
    **dict.fromkeys(("clock", "name"), "Node"),
    **dict.fromkeys(("sensor front", "sensor imu"), "Sensors"),
}


@pytest.fixture
def aggregator() -> Aggregator:
    return load()


def load() -> Aggregator:
    content = yaml.safe_load(FILE.read_text())
    assert list(content) == ["analyzers"], "the name of the aggregator's node"
    assert list(content["analyzers"]) == ["ros__parameters"]
    return Aggregator(content["analyzers"]["ros__parameters"])


def report(aggregator: Aggregator, now_s: float, **levels: int) -> int:
    """What the node reports once a second, and a few seconds later the robot's level."""
    for subject in ALWAYS:
        aggregator.take(f"hardware_robot: {subject}", levels.pop(subject, OK), now_s)
    for subject, level in levels.items():
        aggregator.take(f"hardware_robot: {subject.replace('_', ' ')}", level, now_s)
    return aggregator.level(now_s + 1)


@each(("subject", "place"), list(PLACES.items()))
def test_each_status_has_one_place(subject: str, place: str) -> None:
    assert load().takers(f"hardware_robot: {subject}") == [place]


def test_a_sound_robot_is_no_alarm_with_sensors_or_without(aggregator: Aggregator) -> None:
    assert report(aggregator, 0.0) == OK
    assert report(aggregator, 1.0, sensor_front=OK) == OK


def test_a_warning_that_is_over_is_forgotten(aggregator: Aggregator) -> None:
    assert report(aggregator, 0.0, clock=WARN) == WARN
    assert report(aggregator, 6.0) == OK


@each("subject", [subject.replace(" ", "_") for subject in PLACES])
def test_each_error_is_the_robots(subject: str) -> None:
    assert report(load(), 0.0, **{subject: ERROR}) == ERROR


def test_a_sensor_that_hangs_is_an_error(aggregator: Aggregator) -> None:
    assert report(aggregator, 0.0, sensor_front=STALE) == ERROR
    assert report(aggregator, 1.0, sensor_front=OK) == OK
    assert report(aggregator, 9.0) == ERROR


def test_a_node_that_died_is_an_error(aggregator: Aggregator) -> None:
    assert report(aggregator, 0.0, sensor_front=OK) == OK
    assert aggregator.level(6.0) == ERROR
