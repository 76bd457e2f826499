import pytest

from wheelwire import open_driver
from wheelwire.cli import robot as commands
from wheelwire.drivers.mock import MockDriver
from wheelwire.motion.kinematics import Twist

SECONDS = 0.22


def test_no_setpoint_lives_for_less_than_the_clocks_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the end of a drive little is left of it, on a bad line less than the clock's bound."""
    lives: list[float] = []
    send = MockDriver.set_velocity

    def noted(robot: MockDriver, linear: float, angular: float, ttl: float) -> None:
        lives.append(ttl)
        send(robot, linear, angular, ttl)

    monkeypatch.setattr(MockDriver, "set_velocity", noted)
    with open_driver("mock") as robot:
        commands._drive(robot, Twist(0.1, 0.0), SECONDS)
    assert max(lives) <= SECONDS
    assert min(lives) >= commands.COMMAND_PERIOD_S
