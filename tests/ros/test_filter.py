"""A filter of robot_localization's kind while the node hears nothing of the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")

from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage

from support.ros_filter import FilterNode
from support.ros_rig import SPEED_MPS, Rig, State, open_rig, stamp_s, stamped_after
from support.stop_host import stopped
from wheelwire_ros.motion_estimator import HELD_MPS
from wheelwire_ros.reader import SILENCE_S

LOST_S = 3.0
OFF_M = 0.1
RATE_HZ = 50.0


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    with open_rig(tmp_path) as rig:
        yield rig


def error_m(rig: Rig, judge: FilterNode) -> float:
    x_m, y_m, _ = judge.place
    return math.hypot(x_m - rig.simulator.get("true.x_m"), y_m - rig.simulator.get("true.y_m"))


def drive(rig: Rig) -> None:
    rig.truth(lambda state: state.x_m > 0.5)


def test_the_link_is_lost_for_three_seconds(rig: Rig) -> None:
    """odom goes on; /tf and joint_states do not pretend to be fresh."""
    state, judge = State(rig.graph), FilterNode(rig.graph)
    transforms = rig.graph.listen(TFMessage, "/tf")
    joints = rig.graph.listen(JointState, "joint_states")
    with rig.driving():
        drive(rig)
        rig.simulator.unplug()
        begin_s = rig.wait_past(LOST_S)
        lost_m = error_m(rig, judge)
        state.wait(lambda values: values["odom"] == "held")
        held = stamped_after(rig.odometry, begin_s + 1.0)
        for stamps_s in (
            [stamp_s(message.transforms[0]) for message in tuple(transforms)],
            [stamp_s(message) for message in tuple(joints)],
        ):
            assert all(a < b for a, b in pairwise(stamps_s))
            assert stamps_s[-1] < begin_s + SILENCE_S
    rig.truth(stopped)
    assert lost_m < OFF_M
    rig.simulator.plug()
    state.wait(lambda values: values["odom"] == "measured")
    # odom went on with the last pose, no velocity, and less and less knowledge.
    last = held[-1]
    rate_hz = (len(held) - 1) / (stamp_s(last) - stamp_s(held[0]))
    assert rate_hz == pytest.approx(RATE_HZ, rel=0.25)
    assert len({one.pose.pose.position.x for one in held}) == 1
    assert all(one.twist.twist.linear.x == one.twist.twist.angular.z == 0 for one in held)
    assert all(a.pose.covariance[0] < b.pose.covariance[0] for a, b in pairwise(held))
    assert math.sqrt(last.pose.covariance[0]) > SPEED_MPS * 2
    assert last.twist.covariance[0] >= HELD_MPS**2
    check_order(rig)


def test_the_device_is_reset(rig: Rig) -> None:
    judge = FilterNode(rig.graph)
    with rig.driving():
        drive(rig)
        boot_id = rig.simulator.reset()
        rig.truth(lambda state: state.boot_id == boot_id)
        rig.truth(stopped)
        rig.wait_past(1.0)
        assert error_m(rig, judge) < OFF_M
    check_order(rig)


def check_order(rig: Rig) -> None:
    """Time never runs backward in odom."""
    assert all(stamp_s(a) < stamp_s(b) for a, b in pairwise(tuple(rig.odometry)))
