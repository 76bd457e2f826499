"""`robot.ranges`, analogue inputs and the gyroscope's bias on the simulated robot."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.command import output, run_json
from support.pages import blocks
from support.range_board import (
    ABOUT_M,
    BOARD,
    FRONT,
    LEFT,
    NAMES,
    simulator_on_board,
)
from wheelwire.drivers.mock import MockDriver
from wheelwire.simulation.simulator import Simulator


@pytest.fixture
def robot() -> Iterator[MockDriver]:
    with MockDriver(realtime=False) as robot:
        robot.board.take_up(BOARD)
        yield robot


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with simulator_on_board() as simulator:
        yield simulator


def test_each_range_sensor_has_its_name(robot: MockDriver) -> None:
    assert (robot.ranges.infos, robot.ranges.latest) == ({}, {})
    robot.simulator.set("range.front_m", 0.8)
    robot.simulator.set("range.left_m", 2.5)
    front, left = robot.ranges.read(FRONT), robot.ranges.read(LEFT)
    assert (front.name, left.name) == (FRONT, LEFT)
    assert front.distance_m == pytest.approx(0.8, abs=ABOUT_M)
    assert left.distance_m == pytest.approx(2.5, abs=ABOUT_M)
    assert (front.min_m, front.max_m, front.field_of_view_rad) == (0.02, 4.0, 0.26)
    assert abs(front.stamp - robot.latest.sample.stamp) < 0.2  # type: ignore[union-attr]
    assert 0 < front.stamp_error_s < 0.01
    assert list(robot.ranges.infos) == [FRONT, LEFT]
    assert robot.ranges.latest == {FRONT: robot.ranges.read(FRONT), LEFT: robot.ranges.read(LEFT)}
    assert [one.info.name for one in robot.sensors.channels] == NAMES


def test_the_page_reads_them_as_it_says(
    simulator: Simulator, capsys: pytest.CaptureFixture[str]
) -> None:
    (block,) = (one for one in blocks("docs/sensors.md") if "ranges.read" in one.text)
    exec(block.text.replace("/dev/ttyUSB0", simulator.port), {})  # noqa: S102
    distance_m, latest, sample = capsys.readouterr().out.splitlines()
    assert float(distance_m) == pytest.approx(1.0, abs=ABOUT_M)
    assert FRONT in latest
    assert float(sample.split()[1]) == pytest.approx(1.0, abs=ABOUT_M)


def test_the_command_shows_them(simulator: Simulator) -> None:
    simulator.set("range.left_m", 10.0)
    simulator.set("analog.2_v", 3.0)
    found = {one["channel"]: one for one in run_json("sensors", simulator.port)}
    assert list(found) == NAMES
    front, left = found["range.front"], found["range.left"]
    assert (front["kind"], front["state"]) == ("range", "OK")
    assert front["value"]["distance_m"] == pytest.approx(1.0, abs=ABOUT_M)
    assert (front["value"]["quality"], left["value"]["quality"]) == ("GOOD", "FAR")
    assert left["value"]["distance_m"] is None
    assert left["value"]["max_m"] == 4.0
    assert found["analog_2"]["kind"] == "analog"
    assert found["analog_2"]["value"] == {"voltage_v": pytest.approx(3.0, abs=0.02)}
    table = output("sensors", simulator.port)
    for word in (*NAMES, "1.00 m", "nothing within 4 m", "3.00 V"):
        assert word in table
