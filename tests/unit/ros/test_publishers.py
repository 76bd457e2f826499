"""The messages, with rclpy's serialisation; without a node."""

from __future__ import annotations

import math
import random
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import BatteryState, JointState

import support.ros  # noqa: F401 - keeps a warning of rclpy's first use quiet
from wheelwire import Pose, Twist
from wheelwire.log.ros_messages import battery_state
from wheelwire_ros import publishers
from wheelwire_ros.motion_estimator import RobotMotion, WheelMotion
from wheelwire_ros.publishers import MotionMessages

POSE_DIAGONAL = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
TWIST_DIAGONAL = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
JOINTS = (["front_left", "rear_left"], ["front_right", "rear_right"])
SETTINGS: dict[str, Any] = {
    "odom_frame_id": "odom",
    "base_frame_id": "base_link",
    "tf_frame_prefix": "robot",
    "tf_frame_prefix_enable": True,
    "left_wheel_names": JOINTS[0],
    "right_wheel_names": JOINTS[1],
    "pose_covariance_diagonal": POSE_DIAGONAL,
    "twist_covariance_diagonal": TWIST_DIAGONAL,
}
STAMP_NS = 1_700_000_000_123_456_789


def motion(chance: random.Random) -> RobotMotion:
    def number() -> float:
        return chance.uniform(-100, 100)

    return RobotMotion(
        Pose(number(), number(), number()),
        np.array([[number() for _ in range(3)] for _ in range(3)]),
        Twist(number(), number()),
        WheelMotion(number(), number()),
        WheelMotion(number(), number()),
        None,
    )


def made_for(*, transform: bool = False) -> MotionMessages:
    return MotionMessages(SETTINGS.__getitem__, has_transform=transform)


def odometry_and_joints(made: MotionMessages, one: RobotMotion, stamp_ns: int) -> Any:
    odometry = made.odometry(one, stamp_ns)
    (joints,) = made.fill(one, stamp_ns)
    return deserialize_message(odometry, Odometry), deserialize_message(joints, JointState)


def check_header(message: Any) -> None:
    assert publishers.time_ns(message.header.stamp) == STAMP_NS
    assert (message.header.frame_id, message.child_frame_id) == ("robot/odom", "robot/base_link")


@pytest.mark.parametrize("seed", range(20))
def test_odometry(seed: int) -> None:
    one = motion(random.Random(seed))
    message, _ = odometry_and_joints(made_for(), one, STAMP_NS)
    check_header(message)
    position, rotation = message.pose.pose.position, message.pose.pose.orientation
    assert (position.x, position.y, position.z) == (one.pose.x_m, one.pose.y_m, 0.0)
    assert (rotation.x, rotation.y) == (0.0, 0.0)
    turned = 2 * math.atan2(rotation.z, rotation.w) - one.pose.heading_rad
    assert math.remainder(turned, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    covariance = np.diag(POSE_DIAGONAL)
    covariance[np.ix_([0, 1, 5], [0, 1, 5])] += one.covariance
    assert np.array_equal(np.reshape(message.pose.covariance, (6, 6)), covariance)
    twist = message.twist.twist
    assert (twist.linear.x, twist.linear.y, twist.linear.z) == (one.twist.linear_mps, 0.0, 0.0)
    assert (twist.angular.x, twist.angular.y, twist.angular.z) == (0, 0, one.twist.angular_radps)
    assert np.array_equal(np.reshape(message.twist.covariance, (6, 6)), np.diag(TWIST_DIAGONAL))


def test_all_wheels_of_a_side_turn_together() -> None:
    one = motion(random.Random(1))
    _, message = odometry_and_joints(made_for(), one, STAMP_NS)
    assert publishers.time_ns(message.header.stamp) == STAMP_NS
    assert message.name == [*JOINTS[0], *JOINTS[1]]
    wheels = (one.left, one.left, one.right, one.right)
    assert list(message.position) == [wheel.angle_rad for wheel in wheels]
    assert list(message.velocity) == [wheel.velocity_radps for wheel in wheels]


def test_the_transform_is_the_odometrys_pose() -> None:
    tf2 = pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")
    made, one = made_for(transform=True), motion(random.Random(7))
    odometry = made.odometry(one, STAMP_NS)
    _, transform = made.fill(one, STAMP_NS)
    pose = deserialize_message(odometry, Odometry).pose.pose
    (message,) = deserialize_message(transform, tf2.TFMessage).transforms
    check_header(message)
    translation = message.transform.translation
    assert (translation.x, translation.y, translation.z) == (pose.position.x, pose.position.y, 0.0)
    assert message.transform.rotation == pose.orientation


def battery(*measured: float) -> BatteryState:
    numbers = publishers.battery_numbers(*measured)
    return deserialize_message(battery_state("base").fill(1, 2, *numbers), BatteryState)


@pytest.mark.parametrize(
    ("current_a", "status"), [(1.5, "DISCHARGING"), (-0.8, "CHARGING"), (0.005, "UNKNOWN")]
)
def test_a_batterys_current_is_negative_while_it_discharges(current_a: float, status: str) -> None:
    message = battery(7.4, math.nan, math.nan, current_a)
    assert message.current == pytest.approx(-current_a)
    assert message.power_supply_status == getattr(message, f"POWER_SUPPLY_STATUS_{status}")


def test_one_of_a_kind_passes_in_a_period_although_the_clock_restarts() -> None:
    pace = publishers.Pace(publishers.NANOSECONDS)
    half_seconds = [*range(200, 220), *range(2, 22)]
    assert sum(pace.is_due(one * publishers.NANOSECONDS // 2) for one in half_seconds) == 20


def test_two_kinds_that_alternate_are_two_in_a_period() -> None:
    pace = publishers.Pace(5.0)
    assert sum(pace.is_due(tick / 50, tick % 2) for tick in range(240)) == 2
    assert pace.is_due(5.0, 0)


def test_a_battery_says_what_it_does_not_know() -> None:
    message = battery(7.4, math.nan, math.nan)
    assert message.voltage == pytest.approx(7.4)
    assert math.isnan(message.current)
    assert math.isnan(message.percentage)
    assert message.power_supply_status == message.POWER_SUPPLY_STATUS_UNKNOWN


@pytest.mark.parametrize(
    ("voltage_v", "share"), [(5.0, 0.0), (6.0, 0.0), (7.2, 0.5), (8.4, 1.0), (9.0, 1.0)]
)
def test_a_batterys_charge_lies_on_a_line_between_two_voltages(
    voltage_v: float, share: float
) -> None:
    assert battery(voltage_v, 6.0, 8.4).percentage == pytest.approx(share)
