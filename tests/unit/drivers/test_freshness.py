"""No sample of a robot that is out of reach, or has fallen silent, in real and virtual time."""

from __future__ import annotations

import time
from typing import cast

import pytest

from support.pty_device import PtyDevice
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.mock import MockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire.robot.sensors import READ_WITHIN_S, Sensors, SensorStatus, wait_until_read
from wheelwire.samples import SensorInfo
from wheelwire_protocol.codes import PeripheralKind, Place, SensorState, SupervisorState
from wheelwire_protocol.peripherals import SensorChip

pytestmark = pytest.mark.timeout(60)


def test_nothing_is_read_while_unplugged_nor_from_before_the_plug(
    device: PtyDevice, robot: SerialDriver
) -> None:
    robot.read()
    time.sleep(0.05)  # one is left unread
    device.unplug()
    wait_until(lambda: not robot.is_open)
    for _ in range(3):
        with pytest.raises(errors.LinkLost):
            robot.read(0.05)
    device.plug()
    plugged_s = time.monotonic()
    assert robot.read(10).stamp > plugged_s


def test_a_reset_in_virtual_time_leaves_nothing_to_read() -> None:
    with MockDriver(realtime=False) as robot:
        boot_id = robot.read().boot_id
        robot.advance(0.05)
        robot.simulator.reset()
        while robot.is_open:
            robot.advance(0.001)
        with pytest.raises(errors.LinkLost):
            robot.read(0)
        assert robot.read(5).boot_id != boot_id


def test_health(device: PtyDevice, robot: SerialDriver) -> None:
    end = time.monotonic() + 1.2
    while time.monotonic() < end:
        robot.read()
    health = robot.health
    assert health.is_open
    assert health.age_s is not None
    assert health.age_s < 1
    assert health.rate_hz > 20
    assert 0 <= health.loss < 0.1
    assert 0 < health.clock_error_s < 0.1
    assert health.latched is None
    robot.estop()
    while robot.read().state is not SupervisorState.ESTOPPED:
        pass
    assert robot.health.latched is SupervisorState.ESTOPPED
    device.unplug()
    wait_until(lambda: not robot.is_open)
    time.sleep(0.3)
    health = robot.health
    assert not health.is_open
    assert health.age_s is not None
    assert health.age_s > 0.25


class Channels:
    """Sensors of which each look finds the next states; the last ones remain."""

    def __init__(self, rate_hz: int, *states: SensorState) -> None:
        self._info = SensorInfo(
            0, "imu", PeripheralKind.IMU, SensorChip.NONE, Place.NONE, rate_hz, 0.0, 0.0
        )
        self._left = list(states)
        self.looks = 0

    @property
    def channels(self) -> tuple[SensorStatus, ...]:
        self.looks += 1
        state = self._left.pop(0) if len(self._left) > 1 else self._left[0]
        return (SensorStatus(self._info, state, None, None),)


@pytest.mark.parametrize(
    ("rate_hz", "states", "looks"),
    [
        (200, (SensorState.OK,), 1),
        (200, (SensorState.UNREAD, SensorState.MISSED, SensorState.OK), 3),
        (200, (SensorState.MISSED, SensorState.ABSENT), 2),
        (0, (SensorState.UNREAD, SensorState.MISSED), 2),
    ],
)
def test_a_sample_that_is_too_old_is_waited_for_unless_the_line_has_no_room(
    rate_hz: int, states: tuple[SensorState, ...], looks: int
) -> None:
    sensors = Channels(rate_hz, *states)
    wait_until_read(cast("Sensors", sensors))
    assert sensors.looks == looks


def test_a_sensor_that_sends_nothing_more_is_waited_for_1_5_s() -> None:
    began_s = time.monotonic()
    wait_until_read(cast("Sensors", Channels(200, SensorState.MISSED)))
    assert time.monotonic() - began_s >= READ_WITHIN_S
