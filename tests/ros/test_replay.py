"""A recording of joint_states, replayed by the example."""

from __future__ import annotations

import math
import runpy
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from sensor_msgs.msg import JointState

from support.ros import Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, Rig, open_rig, twist
from support.stop_host import stopped
from wheelwire import DifferentialDrive
from wheelwire_ros.publishers import time_ns

EXAMPLE = Path(__file__).parents[2] / "examples" / "replay_joint_states.py"
LONGEST_NS = 30_000_000
"""Between two messages at 50 Hz."""
GEOMETRY = ("wheel_separation", "wheel_radius", "counts_per_revolution", "max_velocity_mps")


def drive_a_bend_and_back(rig: Rig) -> None:
    with Repeater(rig.commands, lambda: twist(0.3, 1.5)):
        wait(lambda: rig.x_m() > 0.1, "a stretch of the way")
    with Repeater(rig.commands, lambda: twist(-0.2, 0.7)):
        rig.truth(lambda state: state.left_mps < -0.1)
    rig.truth(stopped)


def test_joint_states_replay_to_the_pose_of_odom_bit_by_bit(tmp_path: Path) -> None:
    with open_rig(tmp_path) as rig:
        joints = rig.graph.listen(JointState, "joint_states")
        wait(lambda: joints, "joint_states")
        drive_a_bend_and_back(rig)
        geometry = [rig.graph.parameter(NODE, name) for name in GEOMETRY]
        odometry = {time_ns(message.header.stamp): message for message in tuple(rig.odometry)}
    replay = runpy.run_path(str(EXAMPLE))["JointReplay"](DifferentialDrive(*geometry))
    compared = moved = 0
    last_ns = None
    for message in tuple(joints):
        stamp_ns = time_ns(message.header.stamp)
        if last_ns is not None and stamp_ns - last_ns > LONGEST_NS:
            break  # on a busy computer DDS may drop messages; the poses before are exact
        last_ns = stamp_ns
        replayed = replay.update(message)
        there = odometry.get(stamp_ns)
        if there is None:
            continue
        position, rotation = there.pose.pose.position, there.pose.pose.orientation
        assert (replayed.x_m, replayed.y_m) == (position.x, position.y)
        half_rad = replayed.heading_rad / 2
        assert (math.sin(half_rad), math.cos(half_rad)) == (rotation.z, rotation.w)
        compared += 1
        moved += position.x != 0
    assert moved > 20
    assert compared > moved


PROGRAM = f"""
import runpy, sys
sys.stdout = sys.stderr
runpy.run_path({str(EXAMPLE)!r}, run_name="__main__")
"""


def test_the_program_shows_the_poses_of_odom(tmp_path: Path) -> None:
    with open_rig(tmp_path) as rig, RobotNode(rig.graph, PROGRAM) as program:
        wait(lambda: "x 0.0000 m" in program.errors(), "a first pose")
        drive_a_bend_and_back(rig)

        def shows_odom() -> bool:
            place = rig.odometry[-1].pose.pose.position
            line = program.errors().rstrip().rpartition("\n")[2]
            numbers = [float(word) for word in line.split() if word[-1].isdigit()]
            return numbers[:2] == pytest.approx([place.x, place.y], abs=1e-3)

        wait(lambda: abs(rig.odometry[-1].twist.twist.linear.x) < 1e-3, "standstill in odom")
        wait(shows_odom, "the pose of odom")
