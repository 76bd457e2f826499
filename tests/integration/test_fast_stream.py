"""A stream of more frames than anybody asks for, from the real firmware."""

from __future__ import annotations

import time
from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest

from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.port_policy import REST_US
from wheelwire.link.transports import SerialTransport
from wheelwire.simulation.simulator import Simulator

FRAMES = 1000


class Reads:
    """Counts how often the port is read."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.count = 0
        read = SerialTransport.read

        def counted(transport: SerialTransport) -> bytes:
            self.count += 1
            return read(transport)

        patch.setattr(SerialTransport, "read", counted)


@pytest.fixture
def reads(monkeypatch: pytest.MonkeyPatch) -> Reads:
    return Reads(monkeypatch)


def wait_for_frames(robot: SerialDriver, count: int) -> None:
    end = robot.statistics.frames_received + count
    wait_until(lambda: robot.statistics.frames_received >= end)


def test_a_stream_that_nobody_asks_for_is_read_in_groups(
    simulator: Simulator, reads: Reads
) -> None:
    with SerialDriver(simulator.port, stream_rate_hz=1000) as robot:

        def is_whole_in_few_reads() -> bool:
            """Not where the computer was too busy to empty the port's buffer within 55 ms."""
            count, lost = reads.count, robot.statistics.frames_lost
            wait_for_frames(robot, FRAMES)
            return reads.count - count < FRAMES / 4 and robot.statistics.frames_lost == lost

        wait_until(is_whole_in_few_reads)


def test_a_program_that_reads_now_and_then_waits_for_no_rest(
    simulator: Simulator, reads: Reads
) -> None:
    with SerialDriver(simulator.port, stream_rate_hz=1000) as robot:

        def is_read_in_pairs() -> bool:
            """Not where the computer was too busy, as above."""
            count, frames = reads.count, robot.statistics.frames_received
            ages_s = []
            for _ in range(20):
                time.sleep(0.02)
                ages_s.append(time.monotonic() - robot.read().stamp)
            frames = robot.statistics.frames_received - frames
            return reads.count - count < 0.75 * frames and median(ages_s) < REST_US / 2e6

        wait_until(is_read_in_pairs)


def test_read_returns_samples_as_they_come() -> None:
    with Simulator() as simulator, SerialDriver(simulator.port, stream_rate_hz=1000) as robot:
        wait_for_frames(robot, 100)
        times = [robot.read().t_us for _ in range(FRAMES)]
    assert median(later - earlier for earlier, later in pairwise(times)) < REST_US / 2


def test_five_thousand_states_a_second(simulator: Simulator) -> None:
    with SerialDriver(simulator.port) as robot:
        robot.parameters.set("control_rate_hz", 5000)
    with SerialDriver(simulator.port, stream_rate_hz=5000) as robot:
        wait_for_frames(robot, 5 * FRAMES)
        first = robot.read()
        wait_until(lambda: robot.read().t_us > first.t_us)
        assert (robot.read().t_us - first.t_us) % 200 == 0


def test_a_stop_waits_for_no_rest(simulator: Simulator) -> None:
    with SerialDriver(simulator.port, stream_rate_hz=1000) as robot:
        wait_for_frames(robot, 100)
        robot.set_velocity(0.2, 0.0)
        wait_until(lambda: simulator.get("drive_on"))
        robot.estop()
        assert not simulator.get("drive_on")


def test_a_cable_that_is_pulled_during_a_rest_is_noticed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        Simulator(link=tmp_path / "robot") as simulator,
        SerialDriver(simulator.port, stream_rate_hz=1000) as robot,
    ):
        wait_for_frames(robot, 100)
        simulator.unplug()
        wait_until(lambda: "the port is gone" in caplog.text)  # to ask the driver ends the rest
        simulator.plug()
        wait_for_frames(robot, 100)
        assert robot.statistics.reconnects == 1


def test_a_reset_during_a_rest_is_a_new_session(simulator: Simulator) -> None:
    with SerialDriver(simulator.port, stream_rate_hz=1000) as robot:
        wait_for_frames(robot, 100)
        simulator.reset()
        wait_until(lambda: robot.statistics.device_resets == 1)
        wait_for_frames(robot, 100)
