"""A driver of another package that has no link to a Wheelwire device."""

from __future__ import annotations

import pytest

import wheelwire
from support.linkless_robot import LinklessRobot
from wheelwire.robot.robot import OWN


def test_setpoints_are_held_to_its_own_limits() -> None:
    with LinklessRobot() as robot:
        robot.set_velocity(1.0, 0.0)
        assert robot.sent == [(0.5, 0.5)]
        with pytest.raises(wheelwire.InvalidCommand, match="ttl_max_s is"):
            robot.set_velocity(0.1, 0.0, ttl=0.9)


def test_values_that_only_a_device_knows_are_unknown() -> None:
    robot = LinklessRobot()
    assert robot.is_open
    assert (robot.sessions, robot.held_by, robot.last_stop, robot.asked) == (3, None, None, None)
    assert robot.health.ttl_max_s == 0.8
    assert robot.latest_control_counters() is None
    robot.note("floor", "tiles")


@pytest.mark.parametrize(
    "verb", ["device_counters", "holding", "contradictions", "unsaved_parameters", "memory"]
)
def test_requests_that_only_a_device_answers_are_refused(verb: str) -> None:
    with pytest.raises(wheelwire.DriverUnavailable, match="no Wheelwire device"):
        getattr(LinklessRobot(), verb)()


def test_a_program_can_ask_whether_there_is_a_device() -> None:
    robot = LinklessRobot()
    assert not robot.has_device
    assert not hasattr(robot, "info")
    with pytest.raises(wheelwire.DriverUnavailable, match="no sensors"):
        _ = robot.imu
    with pytest.raises(wheelwire.InvalidCommand, match="LOST"):
        robot.on_lost = print


@pytest.mark.parametrize("name", OWN)
def test_one_that_lacks_a_verb_is_not_made(name: str) -> None:
    lacking = type("Lacking", (LinklessRobot,), {name: getattr(wheelwire.Robot, name)})
    with pytest.raises(TypeError, match=f"lacks {name}:"):
        lacking()
