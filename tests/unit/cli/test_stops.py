"""`stop` and `estop` when the program that holds the port ends at that moment."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import pytest

from wheelwire.cli import robot
from wheelwire.cli.address import Address
from wheelwire.errors import LinkClosed
from wheelwire.robot.robot import Robot


class Stopping:
    """A driver whose link has ended, or not."""

    def __init__(self, *, ends: bool) -> None:
        self.stopped: list[str] = []
        self._ends = ends

    def __enter__(self) -> Stopping:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def stop(self) -> None:
        self._note("stop")

    def estop(self) -> None:
        self._note("estop")

    def _note(self, what: str) -> None:
        if self._ends:
            raise LinkClosed("it has ended")
        self.stopped.append(what)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> list[Stopping]:
    """What is opened, the last one first."""
    drivers: list[Stopping] = []

    def open_to_look(*_: object, **__: object) -> Robot:
        return cast("Robot", drivers.pop())

    monkeypatch.setattr(Address, "open_to_look", open_to_look)
    return drivers


@pytest.mark.parametrize("command", [robot.stop, robot.estop])
def test_it_tries_again_with_the_program_that_holds_the_port_by_then(
    opened: list[Stopping], command: Callable[..., None]
) -> None:
    good = Stopping(ends=False)
    opened += [good, Stopping(ends=True)]
    command("/dev/ttyUSB0", as_json=True)
    assert good.stopped == [command.__name__]


@pytest.mark.parametrize("command", [robot.stop, robot.estop])
def test_it_fails_if_that_ends_too(opened: list[Stopping], command: Callable[..., None]) -> None:
    opened += [Stopping(ends=True), Stopping(ends=True)]
    with pytest.raises(LinkClosed):
        command("/dev/ttyUSB0", as_json=True)
