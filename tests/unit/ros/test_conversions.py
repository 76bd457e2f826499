"""With the message packages; without rclpy."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from wheelwire import Pose, Twist
from wheelwire_ros.estimator import RobotMotion, WheelMotion

pytest.importorskip("nav_msgs.msg", reason="`make ros` brings ROS's messages (Linux, x86-64)")

from wheelwire_ros import conversions
from wheelwire_ros.conversions import Frames

COVARIANCE = np.array([[1.0, 2.0, 3.0], [2.0, 5.0, 6.0], [3.0, 6.0, 9.0]])
MOTION = RobotMotion(
    stamp_s=1.5,
    pose=Pose(1.0, 2.0, math.pi / 2),
    covariance=COVARIANCE,
    twist=Twist(0.3, -0.4),
    left=WheelMotion(10.0, 1.0),
    right=WheelMotion(-20.0, 2.0),
    battery_v=7.4,
)
STAMP = conversions.time_message(12_345_678_901)
FRAMES = Frames("odom", "base_link")


def test_they_need_no_rclpy() -> None:
    code = "import sys, wheelwire_ros.conversions, wheelwire_ros.diagnostics; "
    subprocess.run([sys.executable, "-c", code + "assert 'rclpy' not in sys.modules"], check=True)


@pytest.mark.parametrize("stamp_ns", [0, 999_999_999, 1_000_000_000, 1_700_000_000_123_456_789])
def test_times_go_there_and_back(stamp_ns: int) -> None:
    assert conversions.time_ns(conversions.time_message(stamp_ns)) == stamp_ns


def test_a_twist_is_its_two_components() -> None:
    message = conversions.odometry_message(MOTION, STAMP, FRAMES, [0.0] * 6, np.zeros(36)).twist
    assert conversions.twist_of(message.twist) == MOTION.twist


def test_odometry() -> None:
    message = conversions.odometry_message(
        MOTION, STAMP, FRAMES, [0.5] * 6, conversions.diagonal([1, 2, 3, 4, 5, 6])
    )
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (12, 345_678_901)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_link")
    pose = message.pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (1.0, 2.0, 0.0)
    assert (pose.orientation.z, pose.orientation.w) == pytest.approx((math.sqrt(0.5),) * 2)
    covariance = np.reshape(message.pose.covariance, (6, 6))
    planar = covariance[np.ix_([0, 1, 5], [0, 1, 5])]
    assert planar == pytest.approx(COVARIANCE + 0.5 * np.eye(3))
    assert np.diag(covariance)[2:5] == pytest.approx([0.5] * 3)
    assert np.diag(np.reshape(message.twist.covariance, (6, 6))) == pytest.approx(range(1, 7))


def test_the_transform_is_the_odometrys_pose() -> None:
    odometry = conversions.odometry_message(MOTION, STAMP, FRAMES, [0.0] * 6, np.zeros(36))
    message = conversions.transform_message(odometry)
    assert message.header == odometry.header
    assert message.child_frame_id == "base_link"
    assert (message.transform.translation.x, message.transform.translation.y) == (1.0, 2.0)
    assert message.transform.rotation == odometry.pose.pose.orientation


def test_joints() -> None:
    message = conversions.joint_message(MOTION, STAMP, (["left"], ["right"]))
    assert message.name == ["left", "right"]
    assert list(message.position) == [10.0, -20.0]
    assert list(message.velocity) == [1.0, 2.0]


def test_a_battery_says_what_it_does_not_know() -> None:
    message = conversions.battery_message(7.4, STAMP, "base_link", math.nan, math.nan)
    assert message.voltage == pytest.approx(7.4)
    not_measured = (
        message.temperature,
        message.current,
        message.charge,
        message.capacity,
        message.design_capacity,
        message.percentage,
    )
    assert all(math.isnan(value) for value in not_measured)
    assert message.power_supply_status == message.POWER_SUPPLY_STATUS_UNKNOWN
    assert message.power_supply_health == message.POWER_SUPPLY_HEALTH_UNKNOWN
    assert message.power_supply_technology == message.POWER_SUPPLY_TECHNOLOGY_UNKNOWN
    assert not len(message.cell_voltage)
    assert not len(message.cell_temperature)
    assert not message.location
    assert not message.serial_number
    assert message.present


def test_all_wheels_of_a_side_turn_together() -> None:
    names = ["front_left", "rear_left"], ["front_right", "rear_right"]
    message = conversions.joint_message(MOTION, STAMP, names)
    assert message.name == [*names[0], *names[1]]
    left, right = MOTION.left.angle_rad, MOTION.right.angle_rad
    assert list(message.position) == [left, left, right, right]
