"""The node's parameter `record`: the robot's day in a file, and a robot that drives without one."""

from __future__ import annotations

import signal
import struct
from itertools import pairwise
from pathlib import Path
from statistics import fmean

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from support.range_board import simulator_on_board
from support.ros import Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import SPEED_MPS, twist
from wheelwire.log.reader import is_complete, messages, metadata, records
from wheelwire.log.rerun import Rerun
from wheelwire.motion.kinematics import DifferentialDrive
from wheelwire.motion.odometry import Odometry as Poses


def drive(graph: Graph, node: RobotNode) -> float:
    """Some centimetres, to a halt, and the node's end; how far, by odom."""
    odometry = graph.listen(Odometry, "odom")
    commands = graph.publisher(Twist, "cmd_vel")
    wait(lambda: odometry, "odom")
    with Repeater(commands, lambda: twist(SPEED_MPS)):
        wait(lambda: odometry[-1].pose.pose.position.x > 0.05, "5 cm")
    wait(lambda: odometry[-1].twist.twist.linear.x == 0, "the halt")
    assert node.end(signal.SIGINT) == 0
    return float(odometry[-1].pose.pose.position.x)


def test_a_folder_gets_the_robots_day(graph: Graph, tmp_path: Path) -> None:
    with RobotNode(graph, driver_type="mock", record=str(tmp_path)) as node:
        driven_m = drive(graph, node)
    (file,) = tmp_path.glob("wheelwire-*.mcap")
    assert is_complete(file)
    assert metadata(file)["driver"] == "mock"
    again = Rerun()
    samples = [one.sample() for one in again.feed_all(records(file))]
    assert again.session is not None
    poses = Poses(DifferentialDrive.of_device(again.session.reported.values))
    for sample in samples:
        poses.update(sample)
    assert poses.pose.x_m == pytest.approx(driven_m, abs=0.002)


def test_viewers_find_the_robots_place_and_its_sensors(graph: Graph, tmp_path: Path) -> None:
    file = tmp_path / "day.mcap"
    with (
        simulator_on_board() as simulator,
        RobotNode(graph, port=simulator.port, record=str(file)) as node,
    ):
        drive(graph, node)
    stamps: dict[str, list[float]] = {}
    for topic, _, data in messages(file):
        # A header comes first, behind CDR's own and the number of the transforms.
        seconds, nanoseconds = struct.unpack_from("<iI", data, 8 if topic == "/tf" else 4)
        stamps.setdefault(topic, []).append(seconds + nanoseconds / 1e9)
    assert {"/tf", "/range/front", "/range/left", "/imu/data_raw"} < stamps.keys()
    assert stamps["/tf"] == stamps["/odom"]
    for topic in ("/odom", "/imu/data_raw"):
        steps_s = [b - a for a, b in pairwise(stamps[topic])]
        # At the rate of the node, however late each frame came; the line loses none.
        assert fmean(steps_s) == pytest.approx(0.02, rel=0.03)


def test_a_folder_that_is_missing_costs_the_recording_alone(graph: Graph, tmp_path: Path) -> None:
    missing = tmp_path / "none" / "day.mcap"
    with RobotNode(graph, driver_type="mock", record=str(missing)) as node:
        assert drive(graph, node) > 0.05
    assert "there is no folder" in node.errors_at_end
    assert "the robot is not recorded" in node.errors_at_end
    assert not list(tmp_path.iterdir())
