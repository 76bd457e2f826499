"""Acceleration and jerk of the commands; no stop waits for these limits."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import TwistStamped
from lifecycle_msgs.msg import Transition
from std_srvs.srv import SetBool

from support.ros import Repeater, wait
from support.ros_rig import NODE, Rig, open_rig, stamped_after, twist
from support.stop_host import stopped
from wheelwire_ros.speed_limiter import FIRST_STEP_S, MAX_STEP_S

CMD_VEL_TIMEOUT_S, LONG_S = 0.5, 5.0
REARMED_S = LONG_S + 0.5
"""A longer pause than the one that arms the robot, which is its ttl_max_s."""
HARDLY = 0.001
"""With a deceleration of this, a robot would not stop within the test."""
LIMITED: dict[str, Any] = {
    f"{axis}__{name}": value
    for axis in ("linear__x", "angular__z")
    for name, value in (
        ("max_acceleration", 100.0),
        ("max_deceleration", -HARDLY),
        ("max_deceleration_reverse", HARDLY),
    )
}


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    directory = tmp_path_factory.mktemp("rig")
    with open_rig(
        directory,
        publish_limited_velocity=True,
        cmd_vel_timeout=CMD_VEL_TIMEOUT_S,
        ttl_max_s=LONG_S,
        **LIMITED,
    ) as rig:
        yield rig


@pytest.fixture(scope="module")
def obeyed(rig: Rig) -> deque[Any]:
    return rig.graph.listen(TwistStamped, f"{NODE}/cmd_vel_out")


def stop_by_zero(rig: Rig) -> None:
    rig.commands.publish(twist(0.0))


def stop_by_silence(_rig: Rig) -> None:
    return


def stop_by_estop(rig: Rig) -> None:
    # On a busy computer no answer may come within the second that a call waits for it.
    wait(lambda: rig.graph.call(SetBool, f"{NODE}/estop", data=True).success, "the e-stop")


def stop_by_deactivation(rig: Rig) -> None:
    assert rig.graph.change_state(NODE, Transition.TRANSITION_DEACTIVATE)


@pytest.mark.parametrize(
    "stop", [stop_by_zero, stop_by_silence, stop_by_estop, stop_by_deactivation]
)
def test_no_stop_waits_for_a_limit(rig: Rig, stop: Callable[[Rig], None]) -> None:
    with rig.driving():
        rig.truth(lambda state: state.left_mps > 0.2)
    stop(rig)
    rig.truth(stopped)
    rig.graph.call(SetBool, f"{NODE}/estop", data=False)
    if stop is stop_by_estop:
        rig.arm()
    if stop is stop_by_deactivation:
        assert rig.graph.change_state(NODE, Transition.TRANSITION_ACTIVATE)


def end_motion(rig: Rig, obeyed: deque[Any]) -> float:
    """A command of the last motion may still be in flight: the zero comes after all of them.

    Returns a time after which the next motion begins.
    """
    rig.commands.publish(twist(0.0))
    wait(lambda: obeyed and obeyed[-1].twist.linear.x == 0.0, "the end of the last motion")
    stop_by_estop(rig)  # from here on the next command starts a motion
    assert rig.graph.call(SetBool, f"{NODE}/estop", data=False).success
    rig.truth(stopped)
    rig.arm_at_rest()
    return rig.graph.now_s()


def test_a_motion_after_one_that_was_refused_starts_from_rest(rig: Rig, obeyed: deque[Any]) -> None:
    """The robot refuses each command after the clear; the node must not take it for moving."""
    assert rig.graph.set_parameter(NODE, "cmd_vel_timeout", LONG_S).successful
    assert rig.graph.set_parameter(NODE, "linear.x.max_acceleration", 0.2).successful
    end_motion(rig, obeyed)
    with rig.driving():
        wait(lambda: obeyed and obeyed[-1].twist.linear.x > 0.1, "a motion")
        stop_by_estop(rig)
        assert rig.graph.call(SetBool, f"{NODE}/estop", data=False).success
        assert rig.ignored("unarmed") > 0
    time.sleep(REARMED_S)  # a zero command would be the beginning of the motion
    begin_s = rig.graph.now_s()
    rig.commands.publish(twist(0.3))
    wait(lambda: stamped_after(obeyed, begin_s), "a command")
    assert stamped_after(obeyed, begin_s)[0].twist.linear.x == pytest.approx(0.2 * FIRST_STEP_S)
    assert rig.graph.set_parameter(NODE, "linear.x.max_acceleration", 100.0).successful
    assert rig.graph.set_parameter(NODE, "cmd_vel_timeout", CMD_VEL_TIMEOUT_S).successful


@pytest.mark.parametrize("limit", ["max_acceleration", "max_jerk"])
def test_a_new_limit_applies_to_the_next_motion(rig: Rig, obeyed: deque[Any], limit: str) -> None:
    assert rig.graph.set_parameter(NODE, f"angular.z.{limit}", 1.0).successful
    # After a stall of the computer that outlasts a command, the next one would start from zero.
    assert rig.graph.set_parameter(NODE, "cmd_vel_timeout", LONG_S).successful
    begin_s = end_motion(rig, obeyed)
    with Repeater(rig.commands, lambda: twist(0.1, 1.0)):
        wait(lambda: len(stamped_after(obeyed, begin_s)) > 20, "limited commands")
    turns = [message.twist.angular.z for message in stamped_after(obeyed, begin_s)]
    first = FIRST_STEP_S * (FIRST_STEP_S if limit == "max_jerk" else 1.0)
    assert turns[0] == pytest.approx(first)
    for number, (a, b) in enumerate(pairwise(turns), 2):
        # A step lasts MAX_STEP_S at most; a jerk of 1 adds that much to the acceleration.
        acceleration = number * MAX_STEP_S if limit == "max_jerk" else 1.0
        assert 0 <= b - a <= acceleration * MAX_STEP_S + 1e-9
    assert rig.graph.set_parameter(NODE, f"angular.z.{limit}", 100.0).successful
    assert rig.graph.set_parameter(NODE, "cmd_vel_timeout", CMD_VEL_TIMEOUT_S).successful
