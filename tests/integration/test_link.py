"""The driver against the real firmware on a pseudo-terminal: faults of line, port and device.

On a bad line, but for a port where nothing is understood.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.simulator_on_line import simulator_on
from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import (
    DeviceSilent,
    ForeignDevice,
)
from wheelwire.motion.odometry import Odometry
from wheelwire.samples import WheelSample
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import ResetReason, SupervisorState

TIMEOUT_S = 30.0


@pytest.fixture
def simulator(tmp_path: Path) -> Iterator[Simulator]:
    with simulator_on("noisy", link=tmp_path / "port") as simulator:
        yield simulator


def driven(robot: SerialDriver) -> WheelSample:
    """A sample while being driven: one setpoint may be lost, and an application sends many."""
    robot.set_velocity(0.3, 0.0, ttl=1.0)
    return robot.read(TIMEOUT_S)


def drive_until_driving(robot: SerialDriver) -> None:
    wait_until(lambda: driven(robot).state is SupervisorState.DRIVING)


def test_leaving_the_block_stops_the_robot_before_the_deadline(simulator: Simulator) -> None:
    with SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot:
        wait_until(lambda: driven(robot).left_mps > 0.1)
    wait_until(lambda: simulator.get("drive_on") == 0)
    assert simulator.get("drive_removed_us") < simulator.get("deadline_us")


def test_another_baud_rate_is_found() -> None:
    with (
        simulator_on("noisy", baud_rate=115_200) as simulator,
        SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot,
    ):
        assert robot.info.baud_rate == 115_200
        # The newest sample may be older than the stop behind the zero setpoint of the opening.
        wait_until(lambda: robot.read().state is SupervisorState.IDLE)


def test_an_uncommon_baud_rate_is_named() -> None:
    with Simulator(baud_rate=57_600) as simulator:
        with pytest.raises((DeviceSilent, ForeignDevice), match="921600"):
            SerialDriver(simulator.port, connect_timeout=2.0)
        with SerialDriver(simulator.port, baud_rate=57_600, connect_timeout=10.0) as robot:
            assert robot.info.baud_rate == 57_600


def test_the_roms_boot_text_is_survived() -> None:
    with (
        simulator_on("noisy", settings={"boot_text": 1}) as simulator,
        SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot,
    ):
        boot_id = simulator.reset(ResetReason.BROWNOUT)
        wait_until(lambda: robot.read(TIMEOUT_S).boot_id == boot_id)
        assert robot.info.device.reset_reason is ResetReason.BROWNOUT
        assert robot.statistics.device_resets == 1


def test_unplugged_is_a_state_and_replugged_goes_on(simulator: Simulator) -> None:
    with SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot:
        odometry = Odometry(robot.geometry)
        odometry.update(robot.read())
        wait_until(lambda: odometry.update(driven(robot)).pose.x_m > 0.05)
        simulator.unplug()
        wait_until(lambda: not robot.is_open)
        wait_until(lambda: simulator.get("stands_still") == 1)
        plugged_s = time.monotonic()
        simulator.plug()
        # An earlier sample that no call has read comes first.
        while (sample := robot.read(TIMEOUT_S)).stamp < plugged_s:
            odometry.update(sample)
        # The device went on counting: nothing is lost, nothing jumps.
        assert odometry.update(sample).pose.x_m == pytest.approx(
            simulator.get("true.x_m"), abs=0.002
        )
        assert sample.state is SupervisorState.IDLE
        assert robot.statistics.reconnects >= 1
        drive_until_driving(robot)
