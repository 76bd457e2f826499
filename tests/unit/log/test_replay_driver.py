"""A recording as a robot, from its file."""

from __future__ import annotations

from pathlib import Path

import pytest

import wheelwire
from support.command import check_error, run, run_json
from support.recordings import traffic_of, write
from wheelwire import Odometry, WheelSample, errors, open_driver
from wheelwire.drivers.mock import VirtualMockDriver

Day = tuple[Path, list[WheelSample]]
SETPOINTS = [(0.1, 0.2 * step) for step in range(40)]


@pytest.fixture(scope="module")
def day(tmp_path_factory: pytest.TempPathFactory) -> Day:
    """A file, and the samples that its program has read."""
    seen: list[WheelSample] = []

    def play(robot: VirtualMockDriver) -> None:
        samples = robot.samples()
        robot.parameters.list()
        for linear, angular in SETPOINTS:
            robot.set_velocity(linear, angular)
            robot.advance(0.05)
            seen.extend(iter(samples.poll, None))
        robot.note("weather", {"wind": 3})
        robot.advance(0.05)

    return write(tmp_path_factory.mktemp("day") / "day.mcap", traffic_of(play)), seen


@pytest.mark.parametrize("speed", [0, 1, 50.0])
def test_samples_and_poses_are_those_of_the_day(day: Day, speed: float) -> None:
    path, seen = day
    with open_driver("replay", file=path, speed=speed) as robot:
        again = list(robot.samples())
        geometry = wheelwire.DifferentialDrive(0.2, 0.033, 360.0, 0.4)
    first = again.index(seen[0])
    assert again[first : first + len(seen)] == seen
    ours, theirs = Odometry(geometry), Odometry(geometry)
    poses = [ours.update(sample).pose for sample in again[first : first + len(seen)]]
    assert poses == [theirs.update(sample).pose for sample in seen]
    assert poses[-1].heading_rad > 1


def test_it_can_be_stepped_and_read(day: Day) -> None:
    path, seen = day
    with open_driver("replay", file=str(path), speed=0) as robot:
        assert robot.read() in seen
        robot.advance(0.5)
        assert robot.read().stamp > seen[0].stamp + 0.4
        assert robot.latest is not None
        assert robot.health.is_open
        assert robot.geometry.wheel_radius == 0.033
        left, right = robot.get_encoder_ticks()
        assert left > 0
        assert right > 0


def test_it_knows_what_the_program_noted(day: Day) -> None:
    with open_driver("replay", file=day[0], speed=0) as robot:
        assert robot.noted("weather") == {"wind": 3}
        assert robot.noted("moon") is None


def test_its_parameters_are_those_of_the_day(day: Day) -> None:
    with wheelwire.connect(day[0]) as robot:
        assert robot.parameters["max_duty"] == 1.0
        assert len(robot.parameters.list()) > 30
        with pytest.raises(errors.InvalidCommand, match="is a recording"):
            robot.parameters.set("max_duty", 0.5)


@pytest.mark.parametrize("speed", [-1, float("nan"), 1e9, "fast", None])
def test_a_wrong_speed_is_refused(day: Day, speed: object) -> None:
    with pytest.raises(errors.InvalidArgument, match="speed = "):
        open_driver("replay", file=day[0], speed=speed)  # type: ignore[call-overload]


def test_the_command_line_shows_it(day: Day) -> None:
    path, _ = day
    shown = run("monitor", str(path))
    assert shown.returncode == 0, shown.stderr
    assert "DRIVING" in shown.stdout
    assert run_json("params", "get", str(path), "max_duty") == {"max_duty": 1.0}
    assert "cannot stop" in check_error(run("estop", str(path)), errors.InvalidArgument)
