"""The topics on which the robot's motion is published."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState

from wheelwire import Pose, Twist

from . import conversions
from .conversions import NANOSECONDS, Frames
from .estimator import RobotMotion, WheelMotion
from .message_template import MessageTemplate
from .threads import NodeThreads

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not on PyPI; every ROS installation has it
    TFMessage = None

DEPTH = 10
BATTERY_PERIOD_NS = 1_000_000_000
TF_DEPTH = 100
"""The same as tf2_ros's TransformBroadcaster."""


# What changes from sample to sample. The other components of a planar pose stay 0.
STAMP = (("header.stamp.sec", "i"), ("header.stamp.nanosec", "I"))
POSE = ("position.x", "d"), ("position.y", "d"), ("orientation.z", "d"), ("orientation.w", "d")
AT_REST = RobotMotion(
    stamp_s=0.0,
    pose=Pose(),
    covariance=np.zeros((3, 3)),
    twist=Twist(0.0, 0.0),
    left=WheelMotion(0.0, 0.0),
    right=WheelMotion(0.0, 0.0),
    battery_v=None,
)


class MotionTopics(NamedTuple):
    """What is published, and its names."""

    frames: Frames
    joints: tuple[Sequence[str], Sequence[str]]
    """The names of the left and the right joints."""
    transform: bool
    battery: bool
    battery_range_v: tuple[float, float]
    """The voltages of an empty and of a full battery; NaN where they are not known."""
    pose_diagonal: Sequence[float]
    twist_diagonal: Sequence[float]


class MotionPublisher:
    """Publishes one robot's motion while its lifecycle node is active.

    Args:
        node: The lifecycle node.
        threads: The node's.
        topics: What to publish. `transform` needs tf2_msgs; if it is missing, a warning says so.
    """

    def __init__(self, node: Any, threads: NodeThreads, topics: MotionTopics) -> None:
        self.topics = topics
        self.published = 0
        """Samples published."""
        self._publishes_transform = topics.transform and TFMessage is not None
        self._templates = MotionTemplates(topics)
        self._node = node
        self._threads = threads
        if topics.transform and TFMessage is None:
            node.get_logger().warning("/tf is not published: install tf2_msgs (ros-jazzy-tf2-msgs)")
        self._battery_due_ns = 0
        threads.run_generally(self._create)

    def _create(self) -> None:
        create = self._node.create_lifecycle_publisher
        self._odometry = create(Odometry, "odom", DEPTH)
        self._joints = create(JointState, "joint_states", DEPTH)
        self._publishers = [self._odometry, self._joints]
        if self._publishes_transform:
            self._transform = create(TFMessage, "/tf", TF_DEPTH)
            self._publishers.append(self._transform)
        if self.topics.battery:
            self._battery = create(BatteryState, "battery_state", DEPTH)
            self._publishers.append(self._battery)

    def publish(self, motion: RobotMotion, stamp_ns: int) -> None:
        """Publish the motion at one sample, stamped with the time of its measurement."""
        topics = self.topics
        self._odometry.publish(self._templates.odometry(motion, stamp_ns))
        self.published += 1
        if self._publishes_transform:
            self._transform.publish(self._templates.transform(motion, stamp_ns))
        self._joints.publish(self._templates.joints(motion, stamp_ns))
        if topics.battery and motion.battery_v is not None and stamp_ns >= self._battery_due_ns:
            self._battery_due_ns = stamp_ns + BATTERY_PERIOD_NS
            # Once a second a message may be built the slow way, without a template.
            stamp = conversions.time_message(stamp_ns)
            self._battery.publish(
                conversions.battery_message(
                    motion.battery_v, stamp, topics.frames.base, *topics.battery_range_v
                )
            )

    def destroy(self) -> None:
        """Remove the topics."""
        self._threads.run_generally(self._destroy)

    def _destroy(self) -> None:
        for publisher in self._publishers:
            self._node.destroy_lifecycle_publisher(publisher)


class MotionTemplates:
    """The messages of each sample, serialised: as those of `conversions`, only quicker.

    Args:
        topics: As of `MotionPublisher`.
    """

    def __init__(self, topics: MotionTopics) -> None:
        self._pose_diagonal = topics.pose_diagonal
        self._wheels = [len(names) for names in topics.joints]
        # An array is serialised with its length, so a template is for one number of wheels.
        count = f"{sum(self._wheels)}d"
        stamp = conversions.time_message(0)
        odometry = conversions.odometry_message(
            AT_REST,
            stamp,
            topics.frames,
            topics.pose_diagonal,
            conversions.diagonal(topics.twist_diagonal),
        )
        self._odometry = MessageTemplate(
            odometry,
            [
                *STAMP,
                *((f"pose.pose.{path}", format_) for path, format_ in POSE),
                ("pose.covariance", "36d"),
                ("twist.twist.linear.x", "d"),
                ("twist.twist.angular.z", "d"),
            ],
        )
        self._joints = MessageTemplate(
            conversions.joint_message(AT_REST, stamp, topics.joints),
            [*STAMP, ("position", count), ("velocity", count)],
        )
        if topics.transform and TFMessage is not None:
            one = conversions.transform_message(odometry)
            names = ("translation.x", "translation.y", "rotation.z", "rotation.w")
            self._transform = MessageTemplate(
                TFMessage(transforms=[one]),
                [
                    *((f"transforms.0.{path}", format_) for path, format_ in STAMP),
                    *((f"transforms.0.transform.{name}", "d") for name in names),
                ],
            )

    def odometry(self, motion: RobotMotion, stamp_ns: int) -> bytes:
        """nav_msgs/Odometry."""
        covariance = conversions.pose_covariance(motion.covariance, self._pose_diagonal)
        return self._odometry.fill(
            *_stamp(stamp_ns),
            *_pose(motion.pose),
            covariance,
            (motion.twist.linear_mps,),
            (motion.twist.angular_radps,),
        )

    def transform(self, motion: RobotMotion, stamp_ns: int) -> bytes:
        """tf2_msgs/TFMessage: the same pose."""
        return self._transform.fill(*_stamp(stamp_ns), *_pose(motion.pose))

    def joints(self, motion: RobotMotion, stamp_ns: int) -> bytes:
        """sensor_msgs/JointState."""
        left, right = self._wheels
        wheels = [motion.left] * left + [motion.right] * right
        return self._joints.fill(
            *_stamp(stamp_ns),
            [wheel.angle_rad for wheel in wheels],
            [wheel.velocity_radps for wheel in wheels],
        )


def _stamp(stamp_ns: int) -> tuple[tuple[int], tuple[int]]:
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    return (seconds,), (nanoseconds,)


def _pose(pose: Pose) -> Iterator[tuple[float]]:
    half_rad = pose.heading_rad / 2
    for number in (pose.x_m, pose.y_m, math.sin(half_rad), math.cos(half_rad)):
        yield (number,)


class LimitedVelocityPublisher:
    """Publishes the commands that were obeyed, as limited, on ~/cmd_vel_out.

    Args:
        node: An rclpy node.
        threads: The node's.
        frame: The robot's frame.
    """

    def __init__(self, node: Any, threads: NodeThreads, frame: str) -> None:
        self._node = node
        self._threads = threads
        self._frame = frame
        threads.run_generally(self._create)

    def _create(self) -> None:
        self._publisher = self._node.create_publisher(TwistStamped, "~/cmd_vel_out", DEPTH)

    def publish(self, twist: Twist) -> None:
        """Publish one command, stamped with the current time."""
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(conversions.limited_message(twist, stamp, self._frame))

    def destroy(self) -> None:
        """Remove the topic."""
        self._threads.run_generally(lambda: self._node.destroy_publisher(self._publisher))
