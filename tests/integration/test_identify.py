"""A board is found by what it says of itself, under whichever name its port comes back."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.simulator_on_line import simulator_on
from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator

TIMEOUT_S = 30.0


class Cables:
    """Two robots, and the names under which their ports are to be found."""

    def __init__(self, folder: Path, ours: Simulator, other: Simulator) -> None:
        self.folder = folder
        self.ours = ours
        self.other = other

    @property
    def pattern(self) -> str:
        return str(self.folder / "tty*")

    def name(self, name: str, simulator: Simulator) -> None:
        (self.folder / name).symlink_to(simulator.port)

    def board_id(self, name: str) -> str:
        with SerialDriver(str(self.folder / name), connect_timeout=TIMEOUT_S) as robot:
            return robot.info.device.board_id


@pytest.fixture
def cables(tmp_path: Path) -> Iterator[Cables]:
    with simulator_on("noisy", seed=1) as ours, simulator_on("noisy", seed=2) as other:
        cables = Cables(tmp_path, ours, other)
        cables.name("tty0", other)
        cables.name("tty1", ours)
        yield cables


def test_a_board_that_comes_back_under_another_name_is_found(cables: Cables) -> None:
    board_id = cables.board_id("tty1")
    with SerialDriver(cables.pattern, board_id=board_id) as robot:
        cables.ours.unplug()
        (cables.folder / "tty1").unlink()
        wait_until(lambda: not robot.is_open)
        cables.ours.plug()
        cables.name("tty7", cables.ours)
        since = time.monotonic()
        wait_until(lambda: robot.read(TIMEOUT_S).stamp > since)
        assert robot.info.device.board_id == board_id
        assert robot.info.port.endswith("tty7")


def test_asking_who_is_there_costs_another_robot_nothing(cables: Cables) -> None:
    board_id = cables.board_id("tty1")
    with SerialDriver(str(cables.folder / "tty0")) as other:
        sessions = other.statistics.sessions
        with SerialDriver(cables.pattern, board_id=board_id) as robot:
            assert robot.info.device.board_id == board_id
        other.read(TIMEOUT_S)
        assert other.statistics.sessions == sessions
