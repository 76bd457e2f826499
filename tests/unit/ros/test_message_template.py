"""With the message packages and rclpy's serialisation; without a node."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

import support.ros  # noqa: F401 - keeps a warning of rclpy's first use quiet
from wheelwire import Pose, Twist
from wheelwire_ros import conversions
from wheelwire_ros.conversions import Frames
from wheelwire_ros.estimator import RobotMotion, WheelMotion
from wheelwire_ros.message_template import MessageTemplate
from wheelwire_ros.publishers import MotionTemplates, MotionTopics

POSE_DIAGONAL = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
TWIST_DIAGONAL = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
JOINTS = (["front_left", "rear_left"], ["front_right", "rear_right"])
FRAMES = Frames("robot/odom", "robot/base_link")


def motion(chance: random.Random) -> RobotMotion:
    def number() -> float:
        return chance.uniform(-100, 100)

    return RobotMotion(
        number(),
        Pose(number(), number(), number()),
        np.array([[number() for _ in range(3)] for _ in range(3)]),
        Twist(number(), number()),
        WheelMotion(number(), number()),
        WheelMotion(number(), number()),
        None,
    )


def templates(*, transform: bool) -> MotionTemplates:
    return MotionTemplates(
        MotionTopics(
            frames=FRAMES,
            joints=JOINTS,
            transform=transform,
            battery=False,
            battery_range_v=(math.nan, math.nan),
            pose_diagonal=POSE_DIAGONAL,
            twist_diagonal=TWIST_DIAGONAL,
        )
    )


@pytest.mark.parametrize("seed", range(20))
def test_the_messages_are_those_of_the_conversions(seed: int) -> None:
    chance = random.Random(seed)
    one, stamp_ns = motion(chance), chance.randrange(1 << 60)
    made, stamp = templates(transform=False), conversions.time_message(stamp_ns)
    odometry = conversions.odometry_message(
        one, stamp, FRAMES, POSE_DIAGONAL, conversions.diagonal(TWIST_DIAGONAL)
    )
    assert deserialize_message(made.odometry(one, stamp_ns), Odometry) == odometry
    joints = conversions.joint_message(one, stamp, JOINTS)
    assert deserialize_message(made.joints(one, stamp_ns), JointState) == joints


def test_the_transform_is_that_of_the_conversions() -> None:
    tf2 = pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")
    one, stamp_ns = motion(random.Random(7)), 1_700_000_000_123_456_789
    odometry = conversions.odometry_message(
        one, conversions.time_message(stamp_ns), FRAMES, POSE_DIAGONAL, np.zeros(36)
    )
    message = tf2.TFMessage(transforms=[conversions.transform_message(odometry)])
    made = templates(transform=True).transform(one, stamp_ns)
    assert deserialize_message(made, tf2.TFMessage) == message


def test_one_message_after_the_other() -> None:
    made, chance = templates(transform=False), random.Random(3)
    for stamp_ns in (1, 2, 1 << 60):
        one = motion(chance)
        read: Odometry = deserialize_message(made.odometry(one, stamp_ns), Odometry)
        assert read.pose.pose.position.x == one.pose.x_m
        assert conversions.time_ns(read.header.stamp) == stamp_ns


def test_a_field_that_is_not_there_is_an_error() -> None:
    message = JointState(position=[])
    with pytest.raises(ValueError, match="position"):
        MessageTemplate(message, [("position", "2d"), ("position", "2d")])
