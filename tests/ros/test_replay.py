"""A recording of the topics, replayed into the estimator."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from sensor_msgs.msg import JointState

from support.ros import Repeater, wait
from support.ros_rig import NODE, open_rig, twist
from support.stop_host import stopped
from wheelwire import DifferentialDrive
from wheelwire_ros import conversions
from wheelwire_ros.conversions import time_ns
from wheelwire_ros.replay import JointReplay

GEOMETRY = ("wheel_separation", "wheel_radius", "counts_per_revolution", "max_velocity_mps")


def test_joint_states_replay_to_the_pose_of_odom_bit_by_bit(tmp_path: Path) -> None:
    with open_rig(tmp_path) as rig:
        joints = rig.graph.listen(JointState, "joint_states")
        wait(lambda: joints, "joint_states")
        with Repeater(rig.commands, lambda: twist(0.3, 1.5)):
            wait(lambda: rig.x_m() > 0.1, "a stretch of the way")
        with Repeater(rig.commands, lambda: twist(-0.2, 0.7)):
            rig.truth(lambda state: state.left_mps < -0.1)
        rig.truth(stopped)
        geometry = [rig.graph.parameter(NODE, name) for name in GEOMETRY]
        variance = rig.graph.parameter(NODE, "wheel_variance")
        odometry = {time_ns(message.header.stamp): message for message in tuple(rig.odometry)}
    replay = JointReplay(DifferentialDrive(*geometry), variance)
    compared = moved = 0
    for message in tuple(joints):
        motion = replay.update(message)
        there = odometry.get(time_ns(message.header.stamp))
        if there is None:
            continue
        position = there.pose.pose.position
        assert (motion.pose.x_m, motion.pose.y_m) == (position.x, position.y)
        assert conversions.heading_quaternion(motion.pose.heading_rad) == (
            there.pose.pose.orientation
        )
        compared += 1
        moved += position.x != 0
    assert moved > 20
    assert compared > moved
