"""A stop is written at once by the thread that gives it; its acknowledged twin follows."""

from __future__ import annotations

import threading
from contextlib import suppress

import pytest

from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link import requests
from wheelwire.link.requests import COPY_ID
from wheelwire_protocol.types import Estop, SetDuty, Stop


@pytest.mark.parametrize(("method", "kind"), [("stop", Stop), ("estop", Estop)])
def test_the_caller_writes_a_copy_before_the_one_that_is_acknowledged(
    robot: SerialDriver,
    device: PtyDevice,
    writers: list[int],
    method: str,
    kind: type[Stop | Estop],
) -> None:
    def stop() -> bool:  # what waits for the port at this moment goes first, by its own thread
        getattr(robot, method)()
        return threading.get_ident() in writers

    device.device.forget()  # opening the robot stops it, too
    wait_until(stop)
    ids = [m.request_id for m in device.device.received if isinstance(m, kind)]
    assert ids[0] == COPY_ID
    assert ids[1] != COPY_ID


def test_a_stops_copy_takes_a_number_of_its_own_among_the_setpoints(
    robot: SerialDriver, device: PtyDevice
) -> None:
    device.device.forget()  # opening the robot sends a zero and a stop
    robot.set_duty(0.0, 0.1, ttl=5.0)
    robot.stop()
    robot.set_duty(0.0, 0.1, ttl=5.0)
    robot.stop()
    sent = [m for m in device.device.received if isinstance(m, (Stop, SetDuty))]
    # A busy computer may repeat a message unchanged after others.
    numbers = [message.command_seq for message in dict.fromkeys(sent)]
    assert numbers == sorted(set(numbers))
    assert len(numbers) == 6


def test_the_answer_to_a_copy_is_no_foreign_one(robot: SerialDriver) -> None:
    for _ in range(20):
        robot.stop()
    # A stop that a busy computer repeats is answered twice, and the second answer is foreign.
    assert robot.statistics.foreign <= robot.statistics.requests_repeated < 20


def test_no_acknowledged_stop_has_the_copies_id(
    robot: SerialDriver, device: PtyDevice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(requests, "ID_MODULUS", 3)
    device.device.forget()
    for _ in range(5):
        robot.stop()
    received = [m.request_id for m in device.device.received if isinstance(m, Stop)]
    # One copy for each; the others may have been repeated.
    assert received.count(COPY_ID) == 5
    assert set(received) == {COPY_ID, 1, 2}


def test_without_a_session_nothing_is_copied(robot: SerialDriver, device: PtyDevice) -> None:
    device.unplug()
    with suppress(errors.WheelwireError):
        robot.stop()
    with pytest.raises(errors.LinkLost):
        robot.estop()
