"""A simulated robot that is unplugged at whatever moment of its process."""

from __future__ import annotations

import threading

import pytest

from support.waiting import wait_until
from wheelwire.drivers.mock import MockDriver
from wheelwire.errors import LinkLost, WheelwireError
from wheelwire.simulation.simulator import Simulator

pytestmark = pytest.mark.timeout(60)


class HeldStart:
    """Holds the start of each simulator, before or after its process starts, until `go_on`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, before: bool) -> None:
        self.reached = threading.Event()
        self.go_on = threading.Event()
        self.started: list[Simulator] = []
        start = Simulator.start

        def held(simulator: Simulator) -> None:
            if before:
                self._hold()
            start(simulator)
            self.started.append(simulator)
            if not before:
                self._hold()

        monkeypatch.setattr(Simulator, "start", held)

    def _hold(self) -> None:
        self.reached.set()
        assert self.go_on.wait(30)


def why(robot: MockDriver) -> str:
    """Why it is out of reach."""
    with pytest.raises(LinkLost) as error:
        robot.stop()
    return str(error.value)


def has_ended(simulator: Simulator) -> bool:
    try:
        simulator.get("true.x_m")
    except WheelwireError:
        return True
    return False


@pytest.mark.parametrize("before", [True, False])
def test_one_that_is_unplugged_while_its_process_starts_stays_out_of_reach(
    monkeypatch: pytest.MonkeyPatch, *, before: bool
) -> None:
    with MockDriver() as robot:
        sessions = robot.sessions
        held = HeldStart(monkeypatch, before=before)
        robot.unplug()
        wait_until(lambda: not robot.is_open)
        robot.plug()
        assert held.reached.wait(10)
        robot.unplug()
        held.go_on.set()
        wait_until(lambda: held.started and has_ended(held.started[0]))
        wait_until(lambda: "is unplugged; call plug()" in why(robot))
        assert robot.sessions == sessions
        assert len(held.started) == 1
        robot.plug()
        wait_until(lambda: robot.is_open)
        robot.stop()
