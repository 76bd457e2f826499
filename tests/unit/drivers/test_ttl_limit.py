"""A time to live above the device's limit is refused before it is sent, not cut."""

from __future__ import annotations

import pytest

from support.pty_device import PtyDevice
from support.waiting import stop_and_stand, wait_until
from wheelwire import errors
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.drivers.serial import SerialDriver
from wheelwire_protocol.codec import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.framing import Encoder
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import Hello, ParameterGet, ParameterSet

pytestmark = pytest.mark.timeout(60)


def test_milliseconds_for_seconds_are_refused_by_name(robot: SerialDriver) -> None:
    for command in (robot.set_velocity, robot.set_wheel_velocity, robot.set_duty):
        with pytest.raises(errors.InvalidCommand, match=r"ttl = 300 s.* ttl_max_s is 1 s"):
            command(0.1, 0.1, ttl=300)
    robot.set_velocity(0.1, 0.0, ttl=1.0)
    assert robot.health.ttl_max_s == robot.ttl_max_s == 1.0


def test_the_limit_is_the_devices_and_follows_it(device: PtyDevice, robot: SerialDriver) -> None:
    """A value that no 32-bit float is exactly has to be accepted as it was set."""
    robot.parameters.set("ttl_max_s", 0.7)
    robot.set_duty(0.1, 0.1, ttl=0.7)
    with pytest.raises(errors.InvalidCommand, match=r"0\.7 s"):
        robot.set_duty(0.1, 0.1, ttl=0.71)
    stop_and_stand(robot)  # it changes only then
    robot.parameters.set("ttl_max_s", 4.0)
    robot.set_duty(0.1, 0.1, ttl=4.0)
    # Another program has changed it: the next session reads it.
    device.device.parameters["ttl_max_s"] = 0.5
    device.device.reset()
    while robot.sessions < 2 or not robot.is_open:
        robot.read(10)
    assert robot.ttl_max_s == 0.5
    with pytest.raises(errors.InvalidCommand, match=r"0\.5 s"):
        robot.set_velocity(0.1, 0.0, ttl=0.6)


def test_asking_for_it_sends_nothing_and_waits_for_nothing(
    device: PtyDevice, robot: SerialDriver
) -> None:
    asked = device.device.count(ParameterGet)
    for _ in range(5):
        assert robot.ttl_max_s == 1.0
    assert device.device.count(ParameterGet) == asked
    device.unplug()
    wait_until(lambda: not robot.is_open)
    assert robot.ttl_max_s is None
    with pytest.raises(errors.LinkLost):
        robot.set_velocity(0.1, 0.0, ttl=300)


def test_what_another_session_has_set_is_known_once_ours_is_open_again() -> None:
    """Another host takes the device over, and sets the limit; the device is not reset."""
    other = Encoder()
    with VirtualMockDriver() as robot:
        boot_id, sessions = robot.info.device.boot_id, robot.sessions
        for limit_s in (0.25, 3.0):
            # Together, or ours would be open again before the second one.
            hello = Hello(77, PROTOCOL_VERSION, schema_hash())
            change = ParameterSet(77 ^ boot_id, 1, PARAMETER_BY_NAME["ttl_max_s"].id, limit_s)
            robot.simulator.write(other.encode(hello) + other.encode(change))
            robot.advance(2.0)
            assert robot.ttl_max_s == robot.health.ttl_max_s == limit_s
            robot.set_velocity(0.1, 0.0, ttl=limit_s)
            with pytest.raises(errors.InvalidCommand, match=f"ttl_max_s is {limit_s:g} s"):
                robot.set_velocity(0.1, 0.0, ttl=limit_s + 0.01)
            robot.stop()
        assert robot.sessions == sessions + 2
