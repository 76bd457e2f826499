"""Sensors of a robot on a computer's own pins: its processes, and a bus with faults."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.driver_bench.rig import pin_processes
from support.gpio_chip_process import GpioChip
from support.i2c_bus import I2cBuses
from support.processes import children
from support.waiting import wait_until
from wheelwire import open_driver
from wheelwire.robot.robot import Robot
from wheelwire.tools.files.robot import load_config
from wheelwire_protocol.codes import Reflex, SensorState, SupervisorState

FILE = """\
driver: l298n
parameters: {overrun_limit_us: 1000000, brake_time_s: 0.2, stall_time_s: 5, ttl_max_s: 5}
imu: {chip: mpu6050, bus: 1, forward: y, up: z}
power: {chip: ina219, bus: 1, shunt_mohm: 100}
inputs: {bumper_front: {pin: 8}}
"""
BUMPER_GPIO = 8
WAIT_S = 30.0
"""On a busy test machine."""


class Scene:
    """A Pi: its GPIO chip, its I2C buses, and a robot's file."""

    def __init__(self, directory: Path, patch: pytest.MonkeyPatch, chip: GpioChip) -> None:
        self.chip = chip
        self.buses = I2cBuses(directory / "i2c")
        self.file = directory / "robot.yaml"
        self.file.write_text(FILE)
        environment = chip.environment | self.buses.environment(chip.environment["PYTHONPATH"])
        for name, value in environment.items():
            patch.setenv(name, value)

    def open(self) -> Robot:
        """The robot of the file, on a busy test machine."""
        options = load_config(self.file).driver_options()
        robot: Robot = open_driver("l298n", **options, core_timeout_ms=5000)
        return robot

    def reaches(self, robot: Robot, state: SensorState) -> None:
        wait_until(lambda: robot.imu.state is state, WAIT_S, what=f"imu {state.name}")


@pytest.fixture(scope="module")
def chip(tmp_path_factory: pytest.TempPathFactory) -> Iterator[GpioChip]:
    with GpioChip(tmp_path_factory.mktemp("chip"), kernel_pwm=False) as chip:
        yield chip


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chip: GpioChip) -> Iterator[Scene]:
    yield Scene(tmp_path, monkeypatch, chip)
    assert not chip.truth()["driven"]


@pytest.fixture
def robot(scene: Scene) -> Iterator[Robot]:
    with scene.open() as robot:
        scene.chip.command(f"level {BUMPER_GPIO} 0")
        robot.imu.read(WAIT_S)
        yield robot


def core_of_the_driver() -> int:
    """The process that steps the core."""
    return wait_until(lambda: pin_processes()[1:], WAIT_S, what="the core's process")[0]


def check_steps_while_driving(robot: Robot, count: int) -> None:
    """Once it drives, each of so many states does."""
    robot.set_wheel_velocity(0.1, 0.1, ttl=5)
    wait_until(lambda: robot.read().state is SupervisorState.DRIVING, WAIT_S, what="it drives")
    samples = robot.samples()
    for _ in range(count):
        robot.set_wheel_velocity(0.1, 0.1, ttl=5)
        assert next(samples).state is SupervisorState.DRIVING


def test_samples_states_stamps_and_a_bumper_at_a_gpio(scene: Scene, robot: Robot) -> None:
    imu = robot.imu.read()
    # The chip's z points up, and its y forward.
    assert imu.acceleration[2] == pytest.approx(9.81, abs=0.1)
    assert robot.power.read(WAIT_S).voltage_v == pytest.approx(11.4)
    assert robot.power.read().current_a == pytest.approx(0.5)
    assert [one.info.name for one in robot.sensors.channels] == ["imu", "power", "bumper.front"]
    assert 0 < imu.stamp_error_s < 1
    samples = robot.imu.samples()
    numbers = [next(samples).sample for _ in range(100)]
    assert len(set(numbers)) == 100
    wait_until(lambda: not robot.inputs.read().triggered, WAIT_S, what="the bumper is free")
    scene.chip.command(f"level {BUMPER_GPIO} 1")
    wait_until(
        lambda: robot.inputs.read().triggered == ("bumper.front",), WAIT_S, what="it is pressed"
    )
    assert robot.inputs.read().reflexes is Reflex.NO_FORWARD


def test_a_read_that_does_not_end_delays_neither_a_step_nor_the_close(scene: Scene) -> None:
    with scene.open() as robot:
        robot.imu.read(WAIT_S)
        core = core_of_the_driver()
        (reader,) = children(core)
        scene.buses.set("stuck")
        scene.reaches(robot, SensorState.HUNG)
        check_steps_while_driving(robot, 50)
    assert not Path(f"/proc/{core}").exists()
    wait_until(lambda: not Path(f"/proc/{reader}").exists(), WAIT_S, what="the reader's end")
    # The next one opens on the unchanged bus.
    with scene.open() as robot:
        robot.sensors.start()
        scene.reaches(robot, SensorState.HUNG)
        scene.buses.clear("stuck")
        scene.reaches(robot, SensorState.OK)


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGSTOP])
def test_a_reader_that_dies_or_stops_takes_nothing_with_it(
    robot: Robot, end: signal.Signals
) -> None:
    (reader,) = children(core_of_the_driver())
    os.kill(reader, end)
    known = (SensorState.MISSED, SensorState.HUNG)  # in a transfer it counts as one that hangs
    wait_until(lambda: robot.imu.state in known, WAIT_S, what="imu missed")
    check_steps_while_driving(robot, 20)


def test_the_reader_ends_with_a_core_that_is_killed(robot: Robot) -> None:
    core = core_of_the_driver()
    (reader,) = children(core)
    os.kill(core, signal.SIGKILL)
    wait_until(lambda: not _alive(reader), WAIT_S, what="the reader's end")
    # The driver starts both again, and asks for samples again.
    wait_until(
        lambda: [pid for pid in children(core_of_the_driver()) if pid != reader],
        WAIT_S,
        what="a reader again",
    )
    wait_until(lambda: robot.imu.state is SensorState.OK, WAIT_S, what="imu OK")


def _alive(pid: int) -> bool:
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
