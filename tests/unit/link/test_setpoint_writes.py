"""Setpoints are written by the thread that gives them, beside the one that serves the port."""

from __future__ import annotations

import threading
from collections.abc import Callable
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

Write = Callable[[SerialTransport, bytes], int]


def instead_of_writing(monkeypatch: pytest.MonkeyPatch, stand_in: Callable[[Write], Write]) -> None:
    monkeypatch.setattr(SerialTransport, "write", stand_in(SerialTransport.write))


def test_the_caller_writes_the_frame(robot: SerialDriver, writers: list[int]) -> None:
    def drive() -> bool:  # what waits for the port at this moment goes first, by its own thread
        robot.set_velocity(0.1, 0.0)
        return threading.get_ident() in writers

    wait_until(drive)


def test_threads_draw_each_number_once(robot: SerialDriver, device: PtyDevice) -> None:
    failures: list[BaseException] = []

    def drive() -> None:
        left = EACH
        try:
            while left:
                with suppress(errors.LinkLost):  # no room: nothing was sent
                    robot.set_duty(0.0, 0.1, ttl=5.0)
                    left -= 1
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=drive) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    robot.stop()
    arrived = [message for message in device.device.received if isinstance(message, SetDuty)]
    assert len({setpoint.command_seq for setpoint in arrived}) == THREADS * EACH
    assert device.device.counters.frames == robot.statistics.frames_sent


def test_a_lost_setpoint_is_repeated_though_nothing_comes(
    robot: SerialDriver, device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    device.device.lost.add(WheelState)
    main = threading.get_ident()

    def lose(write: Write) -> Write:
        def losing(self: SerialTransport, data: bytes) -> int:
            return len(data) if threading.get_ident() == main else write(self, data)

        return losing

    instead_of_writing(monkeypatch, lose)
    robot.set_velocity(0.1, 0.0, ttl=5.0)
    wait_until(lambda: device.device.obeyed)


def test_a_setpoint_that_reaches_no_port_raises(
    robot: SerialDriver, device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unplug_first(write: Write) -> Write:
        def unplugged(self: SerialTransport, data: bytes) -> int:
            if threading.current_thread() is threading.main_thread():
                device.unplug()
                wait_until(lambda: not robot.is_open)
            return write(self, data)

        return unplugged

    def drive() -> bool:  # what waits for the port at this moment goes first, by its own thread
        robot.set_velocity(0.1, 0.0)
        return False

    instead_of_writing(monkeypatch, unplug_first)
    with pytest.raises(errors.LinkLost):
        wait_until(drive)
