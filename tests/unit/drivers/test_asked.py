"""What the wheels are asked for now, for programs that only look."""

import pytest

from wheelwire.connect import open_driver
from wheelwire.drivers.mock import VirtualMockDriver
from wheelwire.samples import Setpoint


@pytest.fixture
def robot() -> VirtualMockDriver:
    robot = open_driver("mock", realtime=False)
    assert isinstance(robot, VirtualMockDriver)
    return robot


def test_nothing_is_asked_before_the_first_setpoint(robot: VirtualMockDriver) -> None:
    assert robot.asked is None


def test_the_newest_setpoint_is_asked_until_it_expires(robot: VirtualMockDriver) -> None:
    robot.set_wheel_velocity(0.1, 0.1, ttl=0.5)
    robot.set_wheel_velocity(0.2, -0.1, ttl=0.5)
    robot.advance(0.4)
    assert robot.asked == Setpoint(0.2, -0.1, duty=False)
    robot.advance(0.2)
    assert robot.asked is None


def test_a_duty_is_asked_as_a_duty(robot: VirtualMockDriver) -> None:
    robot.set_duty(0.5, -0.5)
    asked = robot.asked
    assert asked is not None
    assert asked.duty
    assert (asked.left, asked.right) == pytest.approx((0.5, -0.5), abs=1e-4)


@pytest.mark.parametrize("how", ["stop", "estop", "unplug"])
def test_a_stop_or_a_loss_ends_what_is_asked(robot: VirtualMockDriver, how: str) -> None:
    robot.set_wheel_velocity(0.2, 0.2, ttl=0.9)
    assert robot.asked is not None
    getattr(robot, how)()
    robot.advance(0.6)
    assert robot.asked is None
