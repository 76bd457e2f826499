"""The pose outlives the node; and somebody may tell where the robot is."""

from __future__ import annotations

import math
import signal
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry
from std_srvs.srv import Trigger

from support import stop_host
from support.ros import Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, TRUTH_HZ, is_measured, stamped_after, twist, wait_past
from support.stop_host import stopped
from wheelwire import open_driver
from wheelwire.simulation.simulator import Simulator, TrueState
from wheelwire_ros.pose_memory import MOVED_M, MOVED_RAD

X, YAW = 0, 35
"""Indices of the variances in a covariance, row by row."""
CLOSE_M, CLOSE_RAD = 0.01, 0.03


class Home:
    """One robot, and one folder in which its nodes remember, one after the other."""

    def __init__(self, graph: Graph, simulator: Simulator, folder: Path) -> None:
        self.graph = graph
        self.simulator = simulator
        self.folder = folder
        self.odometry: deque[Any] = graph.listen(Odometry, "odom")

    def node(self, **parameters: Any) -> RobotNode:
        return RobotNode(self.graph, port=self.simulator.port, home=self.folder, **parameters)

    def drive(self) -> TrueState:
        """Along a bend, to a stop; returns where the robot is."""
        with Repeater(self.graph.publisher(Twist, "cmd_vel"), lambda: twist(0.3, 0.5)):
            stop_host.wait(self.simulator, lambda state: state.left_mps > 0.1)
            time.sleep(1.0)
        end = stop_host.wait(self.simulator, stopped)
        time.sleep(1.5)  # it rolls out, and the file is written
        return end

    def first(self) -> Any:
        """The first message on odom from now on."""
        begin_s = wait_past(self.graph, self.odometry, 0.0)
        return stamped_after(self.odometry, begin_s)[0]

    def last(self) -> Any:
        """The newest message on odom, once a sample is behind it."""
        wait(lambda: is_measured(self.odometry[-1]), "a sample in odom")
        return self.odometry[-1]

    def truth(self) -> TrueState:
        self.simulator.take_states()
        return stop_host.wait(self.simulator, lambda _: True)

    def check(self, message: Any) -> None:
        """The message is where the robot is."""
        truth, pose = self.truth(), message.pose.pose
        assert math.hypot(pose.position.x - truth.x_m, pose.position.y - truth.y_m) < CLOSE_M
        assert heading_rad(message) == pytest.approx(truth.heading_rad, abs=CLOSE_RAD)

    def file(self) -> Path:
        """The file, once it is there."""
        wait(lambda: self.files, "a file")
        (path,) = self.files
        return path

    @property
    def files(self) -> list[Path]:
        return sorted((self.folder / "wheelwire").glob("*.json"))


def heading_rad(message: Any) -> float:
    turn = message.pose.pose.orientation
    return 2 * math.atan2(turn.z, turn.w)


@pytest.fixture
def home(graph: Graph, tmp_path: Path) -> Iterator[Home]:
    with Simulator(link=tmp_path / "port", truth_hz=TRUTH_HZ) as simulator:
        yield Home(graph, simulator, tmp_path / "home")


def test_a_node_that_starts_again_goes_on_where_the_robot_is(home: Home) -> None:
    """With what the wheels counted meanwhile; after a reset, saying how far it may be off."""
    with home.node() as node:
        home.first()
        home.drive()
        before = home.last()
        node.end(signal.SIGKILL)
    with open_driver("serial", port=home.simulator.port) as robot:  # another program moves it
        for _ in range(20):
            robot.set_wheel_velocity(0.2, 0.2, 0.5)
            time.sleep(0.05)
    stop_host.wait(home.simulator, stopped)
    time.sleep(0.5)
    with home.node() as node:
        after = home.first()
        home.check(after)
        assert after.pose.covariance[X] > before.pose.covariance[X] > 1e-6
        assert "the odometry goes on from" in node.errors()
        assert "may be off by" not in node.errors()
        home.drive()
        node.end(signal.SIGTERM)
    home.simulator.reset()
    with home.node() as node:
        after = home.first()
        home.check(after)
        assert after.pose.covariance[X] >= MOVED_M**2
        assert after.pose.covariance[YAW] >= MOVED_RAD**2
        (line,) = (line for line in node.errors().splitlines() if "may be off by" in line)
        assert "[WARN]" in line
        home.drive()
        node.end(signal.SIGKILL)
    home.simulator.reset()
    time.sleep(1.0)
    with home.node():
        assert home.first().pose.covariance[X] >= 0.4**2  # a second at 0.4 m/s
    assert len(home.files) == 1


def told(x_m: float, heading_rad: float, frame: str = "odom", variance: float = 0.0) -> Any:
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose.position.x = x_m
    message.pose.pose.orientation.z = math.sin(heading_rad / 2)
    message.pose.pose.orientation.w = math.cos(heading_rad / 2)
    message.pose.covariance[X] = variance
    return message


def test_the_pose_can_be_set_and_outlives_the_node(home: Home) -> None:
    def is_set(x_m: float, heading: float) -> bool:
        at = home.last()
        position = at.pose.pose.position
        return math.isclose(position.x, x_m, abs_tol=1e-6) and math.isclose(
            heading_rad(at), heading, abs_tol=1e-6
        )

    with home.node() as node:
        home.first()
        set_pose = home.graph.publisher(PoseWithCovarianceStamped, f"{NODE}/set_pose")
        set_pose.publish(told(2.0, 1.0, variance=0.04))
        wait(lambda: is_set(2.0, 1.0), "the pose")
        assert home.last().pose.covariance[X] == pytest.approx(0.04)
        wrong = told(3.0, 0.0, frame="map"), told(math.nan, 0.0), told(3.0, 0.0, variance=-1)
        for count, message in enumerate(wrong, 1):
            set_pose.publish(message)
            wait(lambda n=count: node.errors().count("set_pose ignored") == n, "a line")  # type: ignore[misc]
        assert is_set(2.0, 1.0)
    with home.node():
        home.first()
        assert is_set(2.0, 1.0)
        assert home.last().pose.covariance[X] == pytest.approx(0.04)
        assert home.graph.call(Trigger, f"{NODE}/reset_odometry").success
        wait(lambda: is_set(0.0, 0.0), "the origin")
