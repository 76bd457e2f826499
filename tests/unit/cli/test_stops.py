"""`stop` and `estop` when the program that holds the port ends at that moment."""

from __future__ import annotations

from collections.abc import Callable
from unittest.mock import MagicMock, call

import pytest

from wheelwire.cli import robot
from wheelwire.cli.address import Address, Given
from wheelwire.errors import LinkClosed


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[MagicMock]:
    """The robots that are opened, the last one first."""
    robots: list[MagicMock] = []
    monkeypatch.setattr(Address, "open_to_look", lambda *_, **__: robots.pop())
    return robots


def robot_of(command: Callable[..., None], error: LinkClosed | None = None) -> MagicMock:
    """One whose link has ended, or not."""
    robot = MagicMock()
    getattr(robot.__enter__.return_value, command.__name__).side_effect = error
    return robot


@pytest.mark.parametrize("command", [robot.stop, robot.estop])
def test_it_tries_again_with_the_program_that_holds_the_port_by_then(
    opened: list[MagicMock], command: Callable[..., None]
) -> None:
    good = robot_of(command)
    opened += [good, robot_of(command, LinkClosed("it has ended"))]
    command(Given("/dev/ttyUSB0"))
    assert good.__enter__.return_value.method_calls == [getattr(call, command.__name__)()]


@pytest.mark.parametrize("command", [robot.stop, robot.estop])
def test_it_fails_if_that_ends_too(opened: list[MagicMock], command: Callable[..., None]) -> None:
    opened += [robot_of(command, LinkClosed("it has ended")) for _ in range(2)]
    with pytest.raises(LinkClosed):
        command(Given("/dev/ttyUSB0"))
