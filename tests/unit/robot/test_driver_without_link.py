"""A driver of another package that has no link to a Wheelwire device."""

from __future__ import annotations

import pytest

import wheelwire
from wheelwire.motion.kinematics import DifferentialDrive, WheelVelocities
from wheelwire.parameters import Parameters
from wheelwire.robot.robot import OWN


class Base(wheelwire.BaseDriver):
    """Only notes what it is asked for."""

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[WheelVelocities] = []

    def stop(self) -> None:
        self.sent.clear()

    estop = clear_estop = clear_fault = shutdown = stop

    @property
    def geometry(self) -> DifferentialDrive:
        return DifferentialDrive(0.2, 0.05, 1000, max_velocity_mps=0.5)

    @property
    def ttl_max_s(self) -> float:
        return 0.8

    @property
    def statistics(self) -> wheelwire.LinkStatistics:
        return wheelwire.LinkStatistics(sessions=3)

    @property
    def parameters(self) -> Parameters:
        raise NotImplementedError

    def _drive_velocity(self, wheels: WheelVelocities, expiry_us: int) -> None:
        assert expiry_us > 0
        self.sent.append(wheels)

    def _drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        raise NotImplementedError

    def _check_link(self) -> None:
        return


def test_setpoints_are_held_to_its_own_limits() -> None:
    with Base() as robot:
        robot.set_velocity(1.0, 0.0)
        assert robot.sent == [(0.5, 0.5)]
        with pytest.raises(wheelwire.InvalidCommand, match="ttl_max_s is"):
            robot.set_velocity(0.1, 0.0, ttl=0.9)


def test_what_only_a_device_knows_is_not_known() -> None:
    robot = Base()
    assert robot.is_open
    assert (robot.sessions, robot.held_by, robot.last_stop, robot.asked) == (3, None, None, None)
    assert robot.health.ttl_max_s == 0.8
    assert robot.latest_control_counters() is None
    robot.note("floor", "tiles")


@pytest.mark.parametrize(
    "verb",
    ["device_counters", "holding", "contradictions", "unsaved_parameters", "memory"],
)
def test_what_only_a_device_does_is_refused(verb: str) -> None:
    with pytest.raises(wheelwire.DriverUnavailable, match="no Wheelwire device"):
        getattr(Base(), verb)()


def test_a_program_can_ask_whether_there_is_a_device() -> None:
    robot = Base()
    assert not robot.has_device
    assert not hasattr(robot, "info")
    with pytest.raises(wheelwire.DriverUnavailable, match="no sensors"):
        _ = robot.imu
    with pytest.raises(wheelwire.InvalidCommand, match="LOST"):
        robot.on_lost = print


@pytest.mark.parametrize("name", OWN)
def test_one_that_lacks_a_verb_is_not_made(name: str) -> None:
    lacking = type("Lacking", (Base,), {name: getattr(wheelwire.Robot, name)})
    with pytest.raises(TypeError, match=f"lacks {name}:"):
        lacking()
