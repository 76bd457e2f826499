import itertools

import pytest

from wheelwire import DeviceRefused, RefusalCode, open_driver
from wheelwire.cli import robot as commands
from wheelwire.drivers.mock import MockDriver
from wheelwire.motion.kinematics import Twist

SECONDS = 0.22


@pytest.fixture
def lives(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """For how long each setpoint sent is valid, in seconds."""
    lives: list[float] = []
    send = MockDriver.set_velocity

    def noted(robot: MockDriver, linear: float, angular: float, ttl: float) -> None:
        lives.append(ttl)
        send(robot, linear, angular, ttl)

    monkeypatch.setattr(MockDriver, "set_velocity", noted)
    return lives


def test_no_setpoint_lives_for_less_than_the_clocks_error(lives: list[float]) -> None:
    """At the end of a drive little is left of it, on a bad line less than the clock's bound."""
    with open_driver("mock") as robot:
        commands._drive(robot, Twist(0.1, 0.0), SECONDS)
    assert max(lives) <= SECONDS
    assert min(lives) >= commands.COMMAND_PERIOD_S


def test_the_last_setpoint_lasts_to_the_end(lives: list[float]) -> None:
    """And no further one has to arrive within the little time that is left."""
    with open_driver("mock") as robot:
        commands._drive(robot, Twist(0.1, 0.0), 2 * commands.TTL_S)
    assert min(lives) >= commands.TTL_S - 2 * commands.COMMAND_PERIOD_S


def test_a_setpoint_that_came_too_late_does_not_end_the_drive(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A busy computer: the device refuses it, which the next call is told."""
    with open_driver("mock") as robot:
        send, calls = robot.set_velocity, itertools.count()

        def refused_once(linear: float, angular: float, ttl: float) -> None:
            if next(calls) == 1:
                raise DeviceRefused(RefusalCode.EXPIRED, "the setpoint")
            send(linear, angular, ttl)

        monkeypatch.setattr(robot, "set_velocity", refused_once)
        driven = commands._drive(robot, Twist(0.1, 0.0), 0.5)
    assert driven.late == 1
    assert driven.pose.x_m > 0.02


def test_a_drive_shorter_than_the_command_period_drives(lives: list[float]) -> None:
    with open_driver("mock") as robot:
        commands._drive(robot, Twist(0.1, 0.0), commands.COMMAND_PERIOD_S / 2)
    assert lives == [commands.COMMAND_PERIOD_S]


def test_a_drive_of_no_time_sends_nothing(lives: list[float]) -> None:
    with open_driver("mock") as robot:
        commands._drive(robot, Twist(0.1, 0.0), 0.0)
    assert not lives
