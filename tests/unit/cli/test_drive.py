import time
from typing import Any

import pytest

from wheelwire import open_driver
from wheelwire.cli import robot as commands
from wheelwire.drivers.mock import MockDriver
from wheelwire.motion.kinematics import Twist
from wheelwire.motion.odometry import Pose

SECONDS = 0.22


@pytest.fixture
def lives(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """For how long each setpoint of a motion is valid, in seconds."""
    lives: list[float] = []
    send = MockDriver.set_velocity

    def noted(robot: MockDriver, linear: float, angular: float, ttl: float) -> None:
        if linear or angular:
            lives.append(ttl)
        send(robot, linear, angular, ttl)

    monkeypatch.setattr(MockDriver, "set_velocity", noted)
    return lives


def drive(seconds: float, **options: Any) -> Pose:
    """A simulated robot, straight on; returns where it ends."""
    with open_driver("mock", **options) as robot:
        return commands._drive(robot, Twist(0.1, 0.0), seconds)[1]


def test_no_setpoint_lives_for_less_than_the_clocks_error(lives: list[float]) -> None:
    """At the end of a drive little is left of it, on a bad line less than the clock's bound."""
    drive(SECONDS)
    assert max(lives) <= SECONDS + commands.COMMAND_PERIOD_S
    assert min(lives) >= commands.COMMAND_PERIOD_S


def test_a_stop_ends_the_drive_and_not_the_last_setpoints_expiry(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its expiry would look like a program that was killed."""
    with open_driver("mock") as robot:
        send, valid_until = robot.set_velocity, [0.0]

        def noted(linear: float, angular: float, ttl: float) -> None:
            if linear:
                valid_until.append(time.monotonic() + ttl)
            send(linear, angular, ttl)

        monkeypatch.setattr(robot, "set_velocity", noted)
        begin = time.monotonic()
        commands._drive(robot, Twist(0.1, 0.0), SECONDS)
    assert valid_until[-1] >= begin + SECONDS + commands.COMMAND_PERIOD_S


def test_the_last_setpoint_lasts_to_the_end(lives: list[float]) -> None:
    """And no further one has to arrive within the little time that is left."""
    drive(2 * commands.TTL_S)
    assert min(lives) >= commands.TTL_S - 2 * commands.COMMAND_PERIOD_S


def test_a_lower_limit_of_the_robots_is_kept(lives: list[float]) -> None:
    assert drive(3 * SECONDS, parameters={"ttl_max_s": 0.15}).x_m > 0.03
    assert max(lives) <= 0.15


def test_a_drive_shorter_than_the_command_period_drives(lives: list[float]) -> None:
    drive(commands.COMMAND_PERIOD_S / 2)
    (life,) = lives
    assert commands.COMMAND_PERIOD_S < life <= 1.5 * commands.COMMAND_PERIOD_S
