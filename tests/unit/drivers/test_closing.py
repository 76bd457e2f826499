"""A driver that is closed says so if its robot drives and could not be stopped."""

from __future__ import annotations

import logging

import pytest

from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver

pytestmark = pytest.mark.timeout(60)

SAID = "closed while the robot drives"


def warnings(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [r.getMessage() for r in caplog.records if r.levelno == logging.WARNING]


def test_a_driving_robot_that_is_unplugged(
    device: PtyDevice, robot: SerialDriver, caplog: pytest.LogCaptureFixture
) -> None:
    robot.set_velocity(0.1, 0.0, ttl=1.0)
    device.unplug()
    wait_until(lambda: not robot.is_open)
    robot.close()
    assert any(SAID in text for text in warnings(caplog))


@pytest.mark.parametrize("before", ["stopped", "standing", "driving"])
def test_nothing_is_logged_for_a_robot_that_stands_or_is_stopped(
    device: PtyDevice, robot: SerialDriver, caplog: pytest.LogCaptureFixture, before: str
) -> None:
    if before != "standing":
        robot.set_velocity(0.1, 0.0, ttl=1.0)
    if before == "stopped":
        robot.stop()
    if before != "driving":  # a driving one is stopped by the closing itself
        device.unplug()
        wait_until(lambda: not robot.is_open)
    robot.close()
    assert not any(SAID in text for text in warnings(caplog))
    assert robot.latest_control_counters() is None
