"""A robot in real time is recorded: by a program, by asyncio, by the environment."""

from __future__ import annotations

import time
from pathlib import Path
from typing import NamedTuple

import pytest
from mcap.reader import make_reader

import wheelwire
from support.waiting import undisturbed
from wheelwire.errors import RecordingError
from wheelwire.link.session import Phase
from wheelwire.link.statistics import LinkStatistics
from wheelwire.log.reader import metadata, records
from wheelwire.log.rerun import Rerun
from wheelwire.simulation.simulator import Simulator


def drive(robot: wheelwire.BaseDriver, seconds: float = 0.5) -> list[wheelwire.WheelSample]:
    """Samples of a short drive. The first may have come before the recording began."""
    found = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        robot.set_velocity(0.2, 0.0, ttl=0.3)
        found.append(robot.read())
    return found


def rerun(path: Path) -> tuple[list[wheelwire.WheelSample], Rerun]:
    again = Rerun()
    return [one.sample() for one in again.feed_all(records(path))], again


def attached(path: Path) -> dict[str, str]:
    with path.open("rb") as file:
        return {one.name: one.data.decode() for one in make_reader(file).iter_attachments()}


class Recorded(NamedTuple):
    """What a program knows of a robot that it recorded."""

    seen: list[wheelwire.WheelSample]
    statistics: LinkStatistics
    board_id: str


def test_a_program_records_its_robot(tmp_path: Path) -> None:
    path = tmp_path / "day.mcap"

    def record() -> Recorded:
        path.unlink(missing_ok=True)
        with wheelwire.open_driver("mock", record=path) as robot:
            seen = drive(robot)
            robot.parameters.set("proportional_gain", 0.5)
            until_attached = time.monotonic() + 1
            while time.monotonic() < until_attached:
                robot.read()
            robot.stop()
            return Recorded(seen, robot.statistics, robot.info.device.board_id)

    seen, statistics, board_id = undisturbed(
        record, lambda one: one.statistics.frames_lost == one.statistics.foreign == 0
    )
    samples, again = rerun(path)
    assert set(seen[1:]) <= set(samples)
    assert again.session is not None
    assert again.session.phase is Phase.CLOSED
    assert again.session.statistics(again.host_us).frames_lost == statistics.frames_lost == 0
    assert again.session.statistics(again.host_us).foreign == 0
    said = metadata(path)
    assert (said["driver"], said["board_id"]) == ("mock", board_id)
    files = attached(path)
    assert set(files) == {"versions.yaml", "parameters.yaml", "board.yaml"}
    assert "proportional_gain" in files["parameters.yaml"]
    assert board_id in files["versions.yaml"]


def test_a_serial_robot_by_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WHEELWIRE_RECORD", str(tmp_path))
    with (
        Simulator(link=tmp_path / "port") as simulator,
        wheelwire.connect(simulator.port) as robot,
    ):
        seen = drive(robot)
    (path,) = tmp_path.glob("wheelwire-*.mcap")
    assert set(seen[1:]) <= set(rerun(path)[0])
    assert metadata(path)["driver"] == "serial"
    # A robot that cannot be recorded still opens: the variable is for all robots of a computer.
    with wheelwire.open_driver("mock", realtime=False) as robot:
        robot.read()
    assert len(list(tmp_path.glob("*.mcap"))) == 1


def test_where_none_can_be_made_no_robot_is_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    missing = tmp_path / "none" / "day.mcap"
    with pytest.raises(RecordingError, match="there is no folder"):
        wheelwire.open_driver("serial", port="/dev/none", record=missing)
    monkeypatch.setenv("WHEELWIRE_RECORD", str(missing))
    with pytest.raises(RecordingError, match="there is no folder"):
        wheelwire.open_driver("mock")
