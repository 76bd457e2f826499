"""The driver against the real firmware on a pseudo-terminal: faults of line, port and device.

On each of the lines, but for a port where nothing is understood.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.simulator_on_line import GOOD, LINES, simulator_on
from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import (
    DeviceRefused,
    DeviceSilent,
    ForeignDevice,
)
from wheelwire.motion.odometry import Odometry
from wheelwire.samples import WheelSample
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import RefusalCode, ResetReason, SupervisorState

TIMEOUT_S = 30.0


@pytest.fixture
def simulator(line: str, tmp_path: Path) -> Iterator[Simulator]:
    with simulator_on(line, link=tmp_path / "port") as simulator:
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


@pytest.mark.parametrize(
    ("line", "baud"), [(GOOD, 2_000_000), *((line, 115_200) for line in LINES)]
)
def test_another_baud_rate_is_found(line: str, baud: int) -> None:
    with (
        simulator_on(line, baud_rate=baud) as simulator,
        SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot,
    ):
        assert robot.info.baud_rate == baud
        # The newest sample may be older than the stop behind the zero setpoint of the opening.
        wait_until(lambda: robot.read().state is SupervisorState.IDLE)


def test_an_uncommon_baud_rate_is_named() -> None:
    with Simulator(baud_rate=57_600) as simulator:
        with pytest.raises((DeviceSilent, ForeignDevice), match="921600"):
            SerialDriver(simulator.port, connect_timeout=2.0)
        with SerialDriver(simulator.port, baud_rate=57_600, connect_timeout=10.0) as robot:
            assert robot.info.baud_rate == 57_600


def test_the_roms_boot_text_is_survived(line: str) -> None:
    with (
        simulator_on(line, settings={"boot_text": 1}) as simulator,
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


def test_a_reset_does_not_make_the_odometry_jump(simulator: Simulator) -> None:
    with SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot:
        odometry = Odometry(robot.geometry)
        odometry.update(robot.read())
        wait_until(lambda: odometry.update(driven(robot)).pose.x_m > 0.1)
        ticks, before_m = robot.get_encoder_ticks(), odometry.pose.x_m
        simulator.reset()
        wait_until(lambda: odometry.update(robot.read(TIMEOUT_S)).rebased)
        # What it rolled from the newest sample to the reset is lost. A jump would be before_m.
        after_m = odometry.pose.x_m
        assert before_m - 0.02 <= after_m <= simulator.get("true.x_m") + 0.02
        assert robot.get_encoder_ticks() >= ticks


def test_estop_latches_until_cleared(simulator: Simulator) -> None:
    with SerialDriver(simulator.port, connect_timeout=TIMEOUT_S) as robot:
        drive_until_driving(robot)
        robot.estop()
        assert simulator.get("drive_on") == 0
        wait_until(lambda: robot.read().state is SupervisorState.ESTOPPED)
        with pytest.raises(DeviceRefused) as refused:
            robot.set_velocity(0.3, 0.0)
        assert refused.value.code == RefusalCode.ESTOPPED
        robot.clear_estop()
        robot.set_velocity(0.0, 0.0)  # a clear alone restarts nothing
        drive_until_driving(robot)


@pytest.mark.parametrize("rate_hz", [20, 200, 1000])
def test_the_rate_asked_is_the_rate_had(line: str, rate_hz: int) -> None:
    with (
        simulator_on(line) as simulator,
        SerialDriver(simulator.port, stream_rate_hz=rate_hz, connect_timeout=TIMEOUT_S) as robot,
    ):
        first, sent, asked = robot.read(), frames_sent_by_device(robot), frames_sent(robot)
        wait_until(lambda: frames_sent_by_device(robot) > sent + 2 * rate_hz)
        last, sent = robot.read(), frames_sent_by_device(robot) - sent
        asked = frames_sent(robot) - asked
        seconds = (last.t_us - first.t_us) / 1e6
        # Some of the frames answer pings, of which there are more while the line is slow.
        assert (sent - asked) / seconds < 1.25 * rate_hz
        assert sent / seconds > 0.75 * rate_hz
        assert line != GOOD or robot.statistics.frames_lost == 0


def frames_sent(robot: SerialDriver) -> int:
    """By the host."""
    return robot.statistics.frames_sent


def frames_sent_by_device(robot: SerialDriver) -> int:
    """Arrived or missed."""
    statistics = robot.statistics
    return statistics.frames_received + statistics.frames_lost
