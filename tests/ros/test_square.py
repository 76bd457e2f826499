"""A client that drives a square by odom alone; what the node says against what the plant does."""

from __future__ import annotations

import itertools
import math
import time
from collections import deque
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState
from tf2_msgs.msg import TFMessage

from support.ros import TIMEOUT_S, Diagnostics, Graph, wait
from support.ros_process import RobotNode
from wheelwire.simulation.simulator import Simulator

SIDE_M = 0.2
CORNERS_M = ((SIDE_M, 0.0), (SIDE_M, SIDE_M), (0.0, SIDE_M), (0.0, 0.0))
ARRIVED_M = 0.02
SPEED_MPS = 0.3
TURN_RADPS = 2.0
PERIOD_S = 0.02
RECENT_S = 5.0
LONG = {"cmd_vel_timeout": 5.0, "ttl_max_s": 5.0}
"""On a busy computer a command may take longer than half a second to the robot."""
NAMES = ["left_wheel_joint", "right_wheel_joint"]


def heading_rad(odometry: Any) -> float:
    orientation = odometry.pose.pose.orientation
    return 2 * math.atan2(orientation.z, orientation.w)


def turned_rad(angle_rad: float) -> float:
    """The same angle, from -pi to pi."""
    return (angle_rad + math.pi) % math.tau - math.pi


class Driver:
    """Looks at nothing but odom."""

    def __init__(self, odometry: deque[Any], publisher: Any) -> None:
        self._odometry = odometry
        self._publisher = publisher

    def go_to(self, x_m: float, y_m: float) -> None:
        end = time.monotonic() + TIMEOUT_S
        while not self._step_to(x_m, y_m):
            assert time.monotonic() < end, f"({x_m}, {y_m}) was not reached"
            time.sleep(PERIOD_S)

    def halt_at(self, x_m: float, y_m: float) -> None:
        """Drive back as long as the robot stands elsewhere, because the stop came late."""
        end = time.monotonic() + TIMEOUT_S
        while True:
            self.go_to(x_m, y_m)
            wait(self._stands, "the robot's halt")
            position = self._odometry[-1].pose.pose.position
            if math.hypot(x_m - position.x, y_m - position.y) < 2 * ARRIVED_M:
                return
            assert time.monotonic() < end, f"it did not halt at ({x_m}, {y_m})"

    def _step_to(self, x_m: float, y_m: float) -> bool:
        """Command once, turning towards the goal before driving; whether it is reached."""
        newest = self._odometry[-1]
        position = newest.pose.pose.position
        away = x_m - position.x, y_m - position.y
        error = turned_rad(math.atan2(away[1], away[0]) - heading_rad(newest))
        linear = SPEED_MPS * max(0.0, math.cos(error)) ** 8
        angular = max(-TURN_RADPS, min(TURN_RADPS, 6 * error))
        self._publisher.publish(Twist(linear=Vector3(x=linear), angular=Vector3(z=angular)))
        return math.hypot(*away) < ARRIVED_M

    def _stands(self) -> bool:
        self._publisher.publish(Twist())
        twist = self._odometry[-1].twist.twist
        return bool(twist.linear.x == twist.angular.z == 0)


def test_a_square(graph: Graph, simulator: Simulator) -> None:
    odometry = graph.listen(Odometry, "odom")
    joints = graph.listen(JointState, "joint_states")
    transforms = graph.listen(TFMessage, "/tf")
    diagnostics = Diagnostics(graph)
    with RobotNode(graph, port=simulator.port, base_frame_id="base_footprint", **LONG):
        publisher = graph.publisher(Twist, "cmd_vel")
        wait(lambda: odometry, "odom")
        driver = Driver(odometry, publisher)
        for corner in CORNERS_M:
            driver.go_to(*corner)
        driver.halt_at(*CORNERS_M[-1])
        end = odometry[-1]
        check_pose(end, simulator)
        check_stamps(graph, odometry)
        check_joints(joints, simulator)
        check_transforms(transforms, odometry)
        link = diagnostics.wait("link", lambda s, _: s.level == DiagnosticStatus.OK)
        assert (link["driver"], link["port"]) == ("serial", simulator.port)
        assert float(link["round_trip_p50_us"]) > 0
        assert float(link["sample_time_error_s"]) < 0.01
        assert link["device_resets"] == link["frames_lost"] == "0"
        obeyed = diagnostics.wait("commands", lambda _, v: int(v["obeyed"]) > 0)
        assert obeyed["ignored"] == "0"
        battery = graph.first(BatteryState, "battery_state")
        assert battery.voltage == pytest.approx(7.4, abs=0.1)
        assert math.isnan(battery.percentage)  # nobody has told the cells


def check_pose(message: Any, simulator: Simulator) -> None:
    """Odometry against truth: the ticks' resolution, and a loop that begins where it ends."""
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_footprint")
    position = message.pose.pose.position
    true = simulator.get("true.x_m"), simulator.get("true.y_m"), simulator.get("true.heading_rad")
    assert (position.x, position.y) == pytest.approx(true[:2], abs=0.01)
    assert turned_rad(heading_rad(message) - true[2]) == pytest.approx(0, abs=0.02)
    assert math.hypot(position.x, position.y) < 2 * ARRIVED_M
    covariance = message.pose.covariance
    assert 0 < covariance[0] < 0.01
    assert 0 < covariance[35] < 0.1


def check_stamps(graph: Graph, odometry: deque[Any]) -> None:
    """Device times, at the rate asked for, and in the past of the clock that reads them."""
    stamps = [m.header.stamp.sec + m.header.stamp.nanosec / 1e9 for m in tuple(odometry)]
    steps = [b - a for a, b in itertools.pairwise(stamps)]
    assert min(steps) > 0
    assert sorted(steps)[len(steps) // 2] == pytest.approx(0.02, rel=0.05)
    now = graph.now_s()
    assert now - RECENT_S < stamps[-1] < now + 0.01


def check_joints(joints: deque[Any], simulator: Simulator) -> None:
    message = joints[-1]
    assert message.name == NAMES
    turns = simulator.get("true.left_ticks") / 360, simulator.get("true.right_ticks") / 360
    assert [a / math.tau for a in message.position] == pytest.approx(turns, abs=0.01)


def check_transforms(transforms: deque[Any], odometry: deque[Any]) -> None:
    """Each is the pose of odom at its time."""
    poses = {(m.header.stamp.sec, m.header.stamp.nanosec): m for m in tuple(odometry)}
    compared = 0
    for message in tuple(transforms):
        (transform,) = message.transforms
        header = transform.header
        same = poses.get((header.stamp.sec, header.stamp.nanosec))
        if same is not None:
            compared += 1
            assert (header.frame_id, transform.child_frame_id) == ("odom", "base_footprint")
            assert transform.transform.translation.x == same.pose.pose.position.x
            assert transform.transform.rotation == same.pose.pose.orientation
    assert compared > 10
