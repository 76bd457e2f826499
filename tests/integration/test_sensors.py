"""`robot.imu`, `robot.power`, `robot.inputs` and `wheelwire sensors` on the simulated robot."""

from __future__ import annotations

import json
import logging
import os
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from support.command import PROGRAM, TIMEOUT_S, output, run_json
from support.processes import talking
from support.range_board import simulator_on_board
from support.waiting import wait_until
from wheelwire import aio, errors, open_driver
from wheelwire.board import DigitalInput, Pull
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.attach import open_or_attach
from wheelwire.tools.files.board import load_board
from wheelwire_protocol.codes import (
    PeripheralKind,
    Place,
    Reflex,
    SensorEventCode,
    SensorState,
)

NAMES = ["imu", "battery", "bumper.front_left", "bumper.front_right"]
FREE = ()
LEFT = ("bumper.front_left",)


@pytest.fixture
def robot() -> Iterator[MockDriver]:
    with MockDriver(realtime=False) as robot:
        yield robot


@pytest.mark.parametrize(
    ("variable", "state"),
    [
        ("imu.absent", SensorState.ABSENT),
        ("imu.bus_hung", SensorState.HUNG),
        ("imu.freeze", SensorState.FROZEN),
    ],
)
def test_a_stale_imu_is_never_handed_out(
    robot: MockDriver, variable: str, state: SensorState
) -> None:
    robot.imu.read()
    events = robot.sensors.events()
    robot.simulator.set(variable, 1)
    robot.advance(0.3)
    assert robot.imu.state is state
    assert robot.imu.latest is None
    with pytest.raises(errors.SensorStale, match=f"imu is STALE, {state.name}") as raised:
        robot.imu.read()
    assert (raised.value.channel, raised.value.state) == ("imu", state)
    assert any(
        (one.name, one.code, one.value) == ("imu", SensorEventCode.STATE, state)
        for one in iter(events.poll, None)
    )
    robot.simulator.set(variable, 0)
    robot.advance(1.5)
    assert robot.imu.state is SensorState.OK
    assert robot.imu.read().acceleration[2] == pytest.approx(9.81, abs=0.5)


def test_a_bumper_that_is_pressed(robot: MockDriver, caplog: pytest.LogCaptureFixture) -> None:
    assert robot.inputs.read().triggered == FREE
    events = robot.sensors.events()
    robot.simulator.set("bumper.front_left", 1)
    with caplog.at_level(logging.INFO, "wheelwire.sensors"):
        robot.advance(0.05)
        sample = robot.inputs.read()
        assert sample.triggered == LEFT
        assert sample.channels["bumper.front_left"].edges == 1
        assert sample.reflexes is Reflex.NO_FORWARD
        robot.simulator.set("bumper.front_left", 0)
        robot.advance(0.2)
        assert robot.inputs.read().triggered == FREE
    said = [one.sentence for one in iter(events.poll, None) if "bumper" in one.name]
    assert said == [
        "bumper.front_left triggered: the robot only backs out",
        "bumper.front_left is free again",
    ]
    logged = {record.levelname: record.getMessage() for record in caplog.records}
    assert logged == {"WARNING": f"mock: {said[0]}", "INFO": f"mock: {said[1]}"}


def test_a_robot_without_sensors_says_so(simulator: Simulator) -> None:
    with SerialDriver(simulator.port) as robot:
        robot.board.take_up(load_board("tb6612"))
        with pytest.raises(errors.SensorMissing, match="no imu: name it in the board's file"):
            robot.imu.read()
        with pytest.raises(errors.SensorMissing):
            robot.inputs.samples()
        assert robot.sensors.channels == ()
    assert run_json("sensors", simulator.port) == []
    assert "no sensor" in output("sensors", simulator.port)


def test_an_imu_for_which_the_line_has_no_room_is_stale() -> None:
    with (
        simulator_on_board(baud_rate=115200) as simulator,
        SerialDriver(simulator.port, baud_rate=115200, stream_rate_hz=180) as robot,
    ):
        with pytest.raises(errors.SensorStale, match="leave it no room on the line: lower"):
            robot.imu.read(timeout=0.1)
        info = robot.imu.info
        assert info is not None
        assert info.rate_hz == 0
        assert robot.imu.state is SensorState.MISSED
        assert robot.imu.latest is None
        assert robot.ranges.read("front").distance_m > 0
        with pytest.raises(errors.SensorStale) as raised:
            robot.imu.read(timeout=0.1)
        assert raised.value.state is SensorState.MISSED


@pytest.mark.parametrize("asked_hz", [7, 50, 150, 190, 1000])
def test_the_rate_is_that_at_which_samples_come(robot: MockDriver, asked_hz: int) -> None:
    robot.sensors.start(rate_hz=asked_hz)
    robot.advance(0.5)
    samples = robot.imu.samples()
    came = 0
    for _ in range(10):
        robot.advance(0.5)
        came += len(list(iter(samples.poll, None)))
    info = robot.imu.info
    assert info is not None
    assert came / 5.0 == pytest.approx(info.rate_hz, abs=0.5)
    (shown,) = (one for one in robot.sensors.channels if one.info.name == "imu")
    assert shown.info == info


async def test_the_same_on_asyncio() -> None:
    async with aio.open_driver("mock") as robot:
        assert (await robot.inputs.read()).triggered == FREE
        events = robot.sensors.events()
        robot.simulator.set("bumper.front_left", 1)
        async for sample in robot.inputs.samples():
            if sample.triggered:
                break
        assert robot.inputs.latest == sample
        assert sample.triggered == LEFT
        async for event in events:
            if event.name == "bumper.front_left":
                break
        assert event.code is SensorEventCode.TRIGGERED
        assert (await robot.power.read(timeout=2.0)).voltage_v > 7
        assert (await robot.imu.read(timeout=2.0)).acceleration[2] > 9
        assert [one.info.name for one in robot.sensors.channels] == NAMES
        await robot.sensors.start(100)
        with pytest.raises(errors.InvalidArgument):
            await robot.sensors.start(0)


def test_a_program_beside_the_one_that_holds_the_robot(simulator: Simulator) -> None:
    """It starts the samples if no program has, and both see them."""
    options: dict[str, Any] = {"port": simulator.port}
    with open_driver("serial", tap=True, **options) as holder:
        beside = open_or_attach("serial", options)
        assert beside.has_device
        with beside:
            assert holder.imu.latest is None
            assert beside.inputs.read().triggered == FREE
            wait_until(lambda: holder.imu.latest is not None)
            assert holder.inputs.read().triggered == FREE
            simulator.set("bumper.front_left", 1)
            wait_until(lambda: beside.inputs.latest is not None)
            wait_until(lambda: beside.inputs.read().triggered == LEFT)
            assert beside.imu.read().acceleration[2] == pytest.approx(9.81, abs=0.5)
            with pytest.raises(errors.InvalidCommand, match="at 200 Hz: call") as raised:
                beside.sensors.start(100)
            assert f"process {os.getpid()} has requested" in str(raised.value)
            holder.sensors.start(100)
            wait_until(lambda: beside.imu.info.rate_hz == 100)  # type: ignore[union-attr]
            beside.sensors.start(100)
        found = {one["channel"]: one for one in run_json("sensors", simulator.port)}
        assert found["bumper.front_left"]["value"]["triggered"] is True


def test_a_recording_has_them(tmp_path: Path, simulator: Simulator) -> None:
    pytest.importorskip("mcap")
    file = tmp_path / "day.mcap"
    with open_driver("serial", port=simulator.port, record=file) as robot:
        events = robot.sensors.events()
        simulator.set("bumper.front_left", 1)
        next(one for one in events if one.name == "bumper.front_left")
        wait_until(lambda: robot.inputs.read().triggered == LEFT)
        robot.power.read(timeout=2.0)
        (recording,) = tmp_path.glob("*.mcap")
    with open_driver("replay", file=recording, speed=0) as day:
        inputs = day.inputs.samples()
        assert next(sample for sample in inputs if sample.triggered).triggered == LEFT
        assert day.power.read(timeout=2.0).voltage_v == pytest.approx(7.4, abs=0.05)


def test_the_command_does_not_take_a_lost_robot_for_one_without_sensors(
    simulator: Simulator,
) -> None:
    words = ("sensors", simulator.port, "--seconds", "60", "--json")
    with talking(*PROGRAM, *words, stderr=subprocess.PIPE) as (command, line):
        assert [one["channel"] for one in json.loads(line)] == NAMES
        simulator.close()
        said, told = command.communicate(timeout=TIMEOUT_S)
    assert command.returncode == errors.LinkLost.exit_code, told
    assert all(json.loads(line) for line in said.splitlines())


def test_a_drive_that_a_cliff_ends_names_it(tmp_path: Path, simulator: Simulator) -> None:
    pytest.importorskip("mcap")
    with SerialDriver(simulator.port) as robot:
        cliff = DigitalInput(PeripheralKind.CLIFF, Place.FRONT, 36, pull=Pull.EXTERNAL)
        robot.board.take_up(replace(load_board("l298n"), peripherals=(cliff,)))
    command = [*PROGRAM, "drive", simulator.port, "--linear", "0.1", "--seconds", "60"]
    with subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "WHEELWIRE_RECORD": str(tmp_path)},
    ) as drive:
        wait_until(lambda: simulator.get("drive_on"))
        simulator.set("cliff.front", 1)
        _, told = drive.communicate(timeout=TIMEOUT_S)
    assert drive.returncode == errors.DeviceRefused.exit_code
    assert "cliff.front saw no floor." in told
    (recording,) = tmp_path.glob("*.mcap")
    (stop,) = run_json("why", str(recording))
    assert stop["cause"] == "cliff_seen"
    line = output("monitor", simulator.port, "--seconds", "0.1").splitlines()[-1]
    assert f"`wheelwire clear {simulator.port}` ends it. EXTERNAL: An input" in line
    later = str(tmp_path / "later.mcap")
    output("log", "record", simulator.port, later, "--seconds", "0.5")
    said = output("why", later)
    assert "It was stopped before the recording began: FAULT, EXTERNAL." in said


def test_the_command_shows_all_channels() -> None:
    found = run_json("sensors", "mock")
    assert [one["channel"] for one in found] == NAMES
    for one in found:
        assert list(one) == ["channel", "kind", "rate_hz", "age_s", "state", "reason", "value"]
        assert (one["state"], one["reason"]) == ("OK", None), one
        assert 0 <= one["age_s"] < 1.5
    assert found[0]["rate_hz"] == 200
    assert found[0]["value"]["acceleration"][2] == pytest.approx(9.81, abs=0.5)
    assert found[1]["value"]["voltage_v"] == pytest.approx(7.4, abs=0.05)
    assert found[2]["value"] == {"triggered": False, "level": 0, "edges": 0}
    table = output("sensors", "mock")
    for word in (*NAMES, "200 Hz", "free", "OK"):
        assert word in table


def test_the_command_names_what_is_stale(simulator: Simulator) -> None:
    simulator.set("imu.absent", 1)
    found = run_json("sensors", simulator.port)[0]
    assert (found["state"], found["reason"]) == ("STALE", "ABSENT")
    assert (found["age_s"], found["value"]) == (None, None)
    assert "ABSENT" in output("sensors", simulator.port)
