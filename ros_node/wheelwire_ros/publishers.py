"""The topics on which the robot's motion is published."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState

from wheelwire import Twist

from . import conversions
from .conversions import Frames
from .estimator import RobotMotion

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not on PyPI; every ROS installation has it
    TFMessage = None

DEPTH = 10
BATTERY_PERIOD_NS = 1_000_000_000
TF_DEPTH = 100
"""The same as tf2_ros's TransformBroadcaster."""


class MotionTopics(NamedTuple):
    """What is published, and its names."""

    frames: Frames
    joints: tuple[Sequence[str], Sequence[str]]
    """The names of the left and the right joints."""
    transform: bool
    battery: bool
    pose_diagonal: Sequence[float]
    twist_diagonal: Sequence[float]


class MotionPublisher:
    """Publishes one robot's motion while its lifecycle node is active.

    Args:
        node: The lifecycle node.
        topics: What to publish. `transform` needs tf2_msgs; if it is missing, a warning says so.
    """

    def __init__(self, node: Any, topics: MotionTopics) -> None:
        self.topics = topics
        self.published = 0
        """Samples published."""
        self._publishes_transform = topics.transform and TFMessage is not None
        self._twist_covariance = conversions.diagonal(topics.twist_diagonal)
        self._node = node
        create = node.create_lifecycle_publisher
        self._odometry = create(Odometry, "odom", DEPTH)
        self._joints = create(JointState, "joint_states", DEPTH)
        self._publishers = [self._odometry, self._joints]
        if topics.transform and TFMessage is None:
            node.get_logger().warning("/tf is not published: install tf2_msgs (ros-jazzy-tf2-msgs)")
        if self._publishes_transform:
            self._transform = create(TFMessage, "/tf", TF_DEPTH)
            self._publishers.append(self._transform)
        if topics.battery:
            self._battery = create(BatteryState, "battery_state", DEPTH)
            self._battery_due_ns = 0
            self._publishers.append(self._battery)

    def publish(self, motion: RobotMotion, stamp_ns: int) -> None:
        """Publish the motion at one sample, stamped with the time of its measurement."""
        topics, stamp = self.topics, conversions.time_message(stamp_ns)
        odometry = conversions.odometry_message(
            motion, stamp, topics.frames, topics.pose_diagonal, self._twist_covariance
        )
        self._odometry.publish(odometry)
        self.published += 1
        if self._publishes_transform:
            self._transform.publish(TFMessage(transforms=[conversions.transform_message(odometry)]))
        self._joints.publish(conversions.joint_message(motion, stamp, topics.joints))
        if topics.battery and motion.battery_v is not None and stamp_ns >= self._battery_due_ns:
            self._battery_due_ns = stamp_ns + BATTERY_PERIOD_NS
            self._battery.publish(
                conversions.battery_message(motion.battery_v, stamp, topics.frames.base)
            )

    def destroy(self) -> None:
        """Remove the topics."""
        for publisher in self._publishers:
            self._node.destroy_lifecycle_publisher(publisher)


class LimitedVelocityPublisher:
    """Publishes the commands that were obeyed, as limited, on ~/cmd_vel_out.

    Args:
        node: An rclpy node.
        frame: The robot's frame.
    """

    def __init__(self, node: Any, frame: str) -> None:
        self._node = node
        self._frame = frame
        self._publisher = node.create_publisher(TwistStamped, "~/cmd_vel_out", DEPTH)

    def publish(self, twist: Twist) -> None:
        """Publish one command, stamped with the current time."""
        stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(conversions.limited_message(twist, stamp, self._frame))

    def destroy(self) -> None:
        """Remove the topic."""
        self._node.destroy_publisher(self._publisher)
