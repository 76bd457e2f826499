"""Setpoints are written by the thread that gives them, beside the one that serves the port."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest

from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.transports import SerialTransport
from wheelwire_protocol.types import SetDuty, WheelState

THREADS = 4
EACH = 500


def test_the_caller_writes_the_frame(robot: SerialDriver, writers: list[int]) -> None:
    def drive() -> bool:  # what waits for the port at this moment goes first, by its own thread
        robot.set_velocity(0.1, 0.0)
        return threading.get_ident() in writers

    wait_until(drive)


def test_threads_draw_each_number_once(robot: SerialDriver, device: PtyDevice) -> None:
    def drive(left: int) -> None:
        while left:
            with suppress(errors.LinkLost):  # no room: nothing was sent
                robot.set_duty(0.0, 0.1, ttl=5.0)
                left -= 1

    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(drive, [EACH] * THREADS))
    robot.stop()
    arrived = device.device.asked(SetDuty)
    assert len({setpoint.command_seq for setpoint in arrived}) == THREADS * EACH
    assert device.device.counters.frames == robot.statistics.frames_sent


def test_a_lost_setpoint_is_repeated_though_nothing_comes(
    robot: SerialDriver, device: PtyDevice, lose_own_writes: Callable[[], None]
) -> None:
    device.device.lost.add(WheelState)
    lose_own_writes()
    robot.set_velocity(0.1, 0.0, ttl=5.0)
    wait_until(lambda: device.device.obeyed)


def test_a_setpoint_that_reaches_no_port_raises(
    robot: SerialDriver, device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = SerialTransport.write

    def unplug_first(self: SerialTransport, data: bytes) -> int:
        if threading.current_thread() is threading.main_thread():
            device.unplug()
            wait_until(lambda: not robot.is_open)
        return write(self, data)

    def drive() -> bool:  # what waits for the port at this moment goes first, by its own thread
        robot.set_velocity(0.1, 0.0)
        return False

    monkeypatch.setattr(SerialTransport, "write", unplug_first)
    with pytest.raises(errors.LinkLost):
        wait_until(drive)
