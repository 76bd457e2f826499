"""A stream of more frames than anybody asks for, from the real firmware."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.transports import SerialTransport
from wheelwire.simulation.simulator import Simulator

FRAMES = 1000


def wait_for_frames(robot: SerialDriver, count: int) -> None:
    end = robot.statistics.frames_received + count
    wait_until(lambda: robot.statistics.frames_received >= end)


def test_it_is_read_in_groups_while_nobody_asks_and_no_call_waits_for_the_rest_between(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    reads, read = [0], SerialTransport.read

    def counted(transport: SerialTransport) -> bytes:
        reads[0] += 1
        return read(transport)

    monkeypatch.setattr(SerialTransport, "read", counted)
    with (
        Simulator(link=tmp_path / "robot") as simulator,
        SerialDriver(simulator.port, stream_rate_hz=1000) as robot,
    ):

        def is_whole_in_few_reads() -> bool:
            """Not where the computer was too busy to empty the port's buffer within 55 ms."""
            count, lost = reads[0], robot.statistics.frames_lost
            wait_for_frames(robot, FRAMES)
            return reads[0] - count < FRAMES / 4 and robot.statistics.frames_lost == lost

        wait_until(is_whole_in_few_reads)
        robot.set_velocity(0.2, 0.0)
        wait_until(lambda: simulator.get("drive_on"))
        robot.estop()
        assert not simulator.get("drive_on")
        simulator.unplug()
        wait_until(lambda: "the port is gone" in caplog.text)  # to ask the driver ends the rest
        simulator.plug()
        wait_for_frames(robot, 100)
        assert robot.statistics.reconnects == 1


def test_five_thousand_states_a_second(simulator: Simulator) -> None:
    with SerialDriver(simulator.port) as robot:
        robot.parameters.set("control_rate_hz", 5000)
    with SerialDriver(simulator.port, stream_rate_hz=5000) as robot:
        wait_for_frames(robot, 5 * FRAMES)
        first = robot.read()
        wait_until(lambda: robot.read().t_us > first.t_us)
        assert (robot.read().t_us - first.t_us) % 200 == 0
