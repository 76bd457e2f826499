"""`robot.ranges`, analogue inputs and the gyroscope's bias on the simulated robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from support.command import output, run_json
from support.pages import blocks
from support.range_board import (
    ABOUT_M,
    BIAS_RADPS,
    BOARD,
    FRONT,
    LEFT,
    NAMES,
    simulator_on_board,
)
from support.waiting import wait_until
from wheelwire import RangeSample, aio, errors, open_driver
from wheelwire.board import ImuSensor
from wheelwire.drivers.mock import MockDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.attach import open_or_attach
from wheelwire_protocol.sensors import IMUS, SensorChip, SensorEventCode, SensorState


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


@pytest.mark.parametrize(("true_m", "distance_m"), [(10.0, math.inf), (0.01, -math.inf)])
def test_a_distance_that_cannot_be_measured_is_infinite(
    robot: MockDriver, true_m: float, distance_m: float
) -> None:
    robot.simulator.set("range.front_m", true_m)
    assert robot.ranges.read(FRONT).distance_m == distance_m
    (shown,) = [one for one in robot.sensors.channels if one.info.name == "range.front"]
    assert shown.state is SensorState.OK


def test_every_sample_comes_once(robot: MockDriver) -> None:
    samples = robot.ranges.samples()
    found: dict[str, list[RangeSample]] = {FRONT: [], LEFT: []}
    for _ in range(6):
        robot.advance(0.5)
        for sample in iter(samples.poll, None):
            found[sample.name].append(sample)
    rate_hz = robot.ranges.infos[FRONT].rate_hz
    for ours in found.values():
        numbers = [sample.sample for sample in ours]
        assert numbers == list(range(numbers[0], numbers[0] + len(ours)))
        spans_s = (ours[-1].stamp - ours[0].stamp) / (len(ours) - 1)
        assert spans_s == pytest.approx(1 / rate_hz, rel=0.2)
    assert samples.dropped == 0


@pytest.mark.parametrize("variable", ["range.absent", "range.hung"])
def test_a_stale_range_is_never_handed_out(robot: MockDriver, variable: str) -> None:
    robot.ranges.read(FRONT)
    events = robot.sensors.events()
    samples = robot.ranges.samples()
    robot.simulator.set(variable, 1)
    robot.advance(1.0)
    assert robot.ranges.latest == {}
    with pytest.raises(errors.SensorStale, match=r"range.front is STALE") as raised:
        robot.ranges.read(FRONT)
    told = {one.name: one for one in iter(events.poll, None)}
    assert told["range.front"].code is SensorEventCode.STATE
    assert told["range.front"].value == raised.value.state
    list(iter(samples.poll, None))
    robot.advance(1.0)
    assert samples.poll() is None
    robot.simulator.set(variable, 0)
    robot.advance(1.5)
    assert robot.ranges.read(FRONT).distance_m == pytest.approx(1.0, abs=ABOUT_M)


def test_a_robot_without_range_sensors_says_so() -> None:
    with MockDriver(realtime=False) as robot:
        with pytest.raises(errors.SensorMissing, match="no range sensor: name it in the board"):
            robot.ranges.read(FRONT)
        with pytest.raises(errors.SensorMissing):
            robot.ranges.samples()
        assert robot.inputs.read().analog == {}


def test_an_unknown_name_is_refused(robot: MockDriver) -> None:
    with pytest.raises(errors.SensorMissing, match=r"sensor 'rear': choose one of front, left, or"):
        robot.ranges.read("rear")
    with pytest.raises(errors.SensorMissing, match="no range sensor"):
        robot.ranges.read(["front"])  # type: ignore[arg-type]
    with pytest.raises(errors.InvalidArgument, match="timeout"):
        robot.ranges.read(FRONT, timeout=-1)


def test_they_go_on_after_a_reset_of_the_device(robot: MockDriver) -> None:
    samples = robot.ranges.samples()
    robot.simulator.reset()
    robot.advance(3.0)
    list(iter(samples.poll, None))
    robot.simulator.set("range.front_m", 0.5)
    robot.advance(0.5)
    newest = [one for one in iter(samples.poll, None) if one.name == FRONT][-1]
    assert newest.distance_m == pytest.approx(0.5, abs=ABOUT_M)


def test_a_voltage_is_that_before_its_divider(robot: MockDriver) -> None:
    robot.simulator.set("analog.2_v", 3.0)
    robot.inputs.read()
    robot.advance(0.2)
    assert robot.inputs.read().analog == {"analog_2": pytest.approx(3.0, abs=0.02)}
    robot.simulator.set("analog.2_v", 0.0)
    robot.advance(0.2)
    assert robot.inputs.read().analog == {"analog_2": 0.0}, "a voltage as any other"


def test_a_stale_voltage_is_never_handed_out(robot: MockDriver) -> None:
    robot.inputs.read()
    robot.simulator.set("analog.failed", 1)
    robot.advance(0.5)
    assert robot.inputs.read().analog == {}
    (shown,) = [one for one in robot.sensors.channels if one.info.name == "analog_2"]
    assert shown.state is SensorState.MISSED
    assert shown.sample is None
    robot.simulator.set("analog.failed", 0)
    robot.advance(1.5)
    assert list(robot.inputs.read().analog) == ["analog_2"]


def test_the_bias_of_the_boards_file_is_taken_off(robot: MockDriver) -> None:
    half_a_count = IMUS[SensorChip.MPU6050].gyro_radps / 2
    _, board = robot.board.read()
    assert board is not None
    stored = board.peripherals[0]
    assert isinstance(stored, ImuSensor)
    assert stored.bias == pytest.approx(BIAS_RADPS, abs=half_a_count)
    samples = robot.imu.samples()
    robot.advance(1.0)
    turns = [sample.gyro for sample in iter(samples.poll, None)]
    for axis, bias_radps in enumerate(BIAS_RADPS):
        mean_radps = sum(turn[axis] for turn in turns) / len(turns)
        assert mean_radps == pytest.approx(-bias_radps, abs=0.002)


async def test_the_same_on_asyncio() -> None:
    async with aio.open_driver("mock", realtime=False) as robot:
        await robot.board.take_up(BOARD)
        assert (await robot.ranges.read(LEFT)).distance_m == pytest.approx(1.0, abs=ABOUT_M)
        async for sample in robot.ranges.samples():
            if sample.name == FRONT:
                break
        assert robot.ranges.latest[FRONT].distance_m == pytest.approx(1.0, abs=ABOUT_M)
        with pytest.raises(errors.SensorMissing):
            await robot.ranges.read("rear")


def test_a_recording_and_an_attached_program_have_them(
    tmp_path: Path, simulator: Simulator
) -> None:
    pytest.importorskip("mcap")
    file = tmp_path / "day.mcap"
    simulator.set("range.front_m", 0.6)
    options: dict[str, Any] = {"port": simulator.port}
    with open_driver("serial", tap=True, record=file, **options) as holder:
        assert holder.ranges.read(FRONT).distance_m == pytest.approx(0.6, abs=ABOUT_M)
        beside = open_or_attach("serial", options)
        assert beside.has_device
        with beside:
            assert beside.ranges.read(FRONT).distance_m == pytest.approx(0.6, abs=ABOUT_M)
        simulator.set("range.front_m", 1.6)
        wait_until(lambda: holder.ranges.read(FRONT).distance_m > 1.5)
    with open_driver("replay", file=file, speed=0) as day:
        seen = [one.distance_m for one in islice(day.ranges.samples(), 6) if one.name == FRONT]
        assert seen[0] == pytest.approx(0.6, abs=ABOUT_M)


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
