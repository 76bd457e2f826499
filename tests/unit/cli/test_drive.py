import pytest

from wheelwire import open_driver
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


def test_a_drive_shorter_than_the_command_period_drives(lives: list[float]) -> None:
    with open_driver("mock") as robot:
        commands._drive(robot, Twist(0.1, 0.0), commands.COMMAND_PERIOD_S / 2)
    assert lives == [commands.COMMAND_PERIOD_S]


def test_a_drive_of_no_time_sends_nothing(lives: list[float]) -> None:
    with open_driver("mock") as robot:
        commands._drive(robot, Twist(0.1, 0.0), 0.0)
    assert not lives
