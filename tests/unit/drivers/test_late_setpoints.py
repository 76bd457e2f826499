"""A command that is too old raises from its own call, and keeps back no other."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

import pytest

from support.pty_device import PtyDevice
from support.staged_stops import StagedRobot
from support.waiting import wait_until
from wheelwire import aio
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import Expired, InvalidCommand
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.types import SetDuty, SetWheelVelocity

pytestmark = pytest.mark.timeout(60)

COMMANDS: tuple[Callable[..., None], ...] = (
    lambda robot, **life: robot.set_velocity(0.1, 0.0, **life),
    lambda robot, **life: robot.set_wheel_velocity(0.1, 0.1, **life),
    lambda robot, **life: robot.set_duty(0.1, 0.1, **life),
)


def refuse_what_is_too_old(robot: Any) -> None:
    for command in COMMANDS:
        with pytest.raises(Expired, match=r"the command is 0\.3\d* s old and its ttl is 0\.3 s"):
            command(robot, ttl=0.3, stamp=time.monotonic() - 0.31)
        with pytest.raises(InvalidCommand, match="in the future"):
            command(robot, ttl=0.3, stamp=time.monotonic() + 1)


def test_a_stamp_too_old_raises_from_that_call_and_nothing_is_sent(
    device: PtyDevice, robot: SerialDriver
) -> None:
    device.device.forget()
    refuse_what_is_too_old(robot)
    assert device.device.count(SetWheelVelocity, SetDuty) == 0
    for command in COMMANDS:
        command(robot, ttl=0.3, stamp=time.monotonic() - 0.1)
    wait_until(lambda: device.device.count(SetWheelVelocity, SetDuty) >= len(COMMANDS))
    assert robot.statistics.setpoints_expired == robot.health.setpoints_expired == 0


async def test_the_same_with_asyncio(device: PtyDevice) -> None:
    async with aio.connect(device.path) as robot:
        device.device.forget()
        refuse_what_is_too_old(robot)
        assert device.device.count(SetWheelVelocity, SetDuty) == 0
        for command in COMMANDS:
            command(robot, ttl=0.3, stamp=time.monotonic() - 0.1)


def test_one_that_comes_too_late_is_counted_and_the_next_one_drives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with VirtualMockDriver() as robot:
        held: list[bytes] = []
        deliver = robot.simulator.write
        monkeypatch.setattr(robot.simulator, "write", held.append)
        robot.set_velocity(0.1, 0.0, ttl=0.02)
        robot.advance(0.05)
        monkeypatch.undo()
        deliver(b"".join(held))
        robot.advance(0.02)
        late = robot.statistics.setpoints_expired
        assert late >= 1
        assert robot.health.setpoints_expired == late
        robot.set_velocity(0.1, 0.0)
        robot.advance(0.05)
        assert robot.read().state is SupervisorState.DRIVING
        assert robot.statistics.setpoints_expired == late


def test_a_line_that_delays_every_setpoint_is_reported_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    robot = StagedRobot()
    robot.open()
    robot.drive(0.2, 0.2, 0.3)
    robot.delay_us = 120_000
    with caplog.at_level(logging.WARNING, "wheelwire"):
        robot.drive(0.2, 0.2, 2.0, ttl_s=0.1)
    said = [one.getMessage() for one in caplog.records if "arrive too late" in one.getMessage()]
    assert len(said) == 1
    assert "longer ttl" in said[0]
    assert robot.session.setpoints.expired > 50


def test_some_that_come_too_late_are_not_worth_a_line(
    caplog: pytest.LogCaptureFixture,
) -> None:
    robot = StagedRobot()
    robot.open()
    robot.drive(0.2, 0.2, 0.3)
    with caplog.at_level(logging.WARNING, "wheelwire"):
        for _ in range(12):
            robot.delay_us = 120_000
            robot.drive(0.2, 0.2, 0.06, ttl_s=0.1)
            robot.delay_us = 0
            robot.run(0.15)  # frames in flight arrive first
            robot.drive(0.2, 0.2, 0.04, ttl_s=0.1)
    assert robot.session.setpoints.expired > 12
    assert robot.sample.state is SupervisorState.DRIVING
    assert "too late" not in caplog.text
