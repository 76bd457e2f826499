"""The topics that say how the robot moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState

from . import conversions
from .conversions import Frames
from .estimator import RobotMotion

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not among the wheels on PyPI; every ROS installation has it
    TFMessage = None

DEPTH = 10
TF_DEPTH = 100
"""As a tf2_ros TransformBroadcaster has it."""


class MotionTopics(NamedTuple):
    """What is published, and under which names."""

    frames: Frames
    joints: tuple[str, str]
    """The left and the right wheel's."""
    transform: bool
    battery: bool
    pose_diagonal: Sequence[float]
    twist_diagonal: Sequence[float]


class MotionPublisher:
    """Publishes one robot's motion while its lifecycle node is active.

    Args:
        node: The lifecycle node.
        topics: See there. `transform` needs tf2_msgs; a warning tells that they are missing.
    """

    def __init__(self, node: Any, topics: MotionTopics) -> None:
        self.topics = topics
        self._publishes_transform = topics.transform and TFMessage is not None
        self._twist_covariance = conversions.diagonal(topics.twist_diagonal)
        self._node = node
        create = node.create_lifecycle_publisher
        self._odometry = create(Odometry, "odom", DEPTH)
        self._joints = create(JointState, "joint_states", DEPTH)
        self._publishers = [self._odometry, self._joints]
        if topics.transform and TFMessage is None:
            node.get_logger().warning("/tf is not published: tf2_msgs is not installed")
        if self._publishes_transform:
            self._transform = create(TFMessage, "/tf", TF_DEPTH)
            self._publishers.append(self._transform)
        if topics.battery:
            self._battery = create(BatteryState, "battery_state", DEPTH)
            self._publishers.append(self._battery)

    def publish(self, motion: RobotMotion, stamp_ns: int) -> None:
        """One sample's worth, with the time at which it was measured."""
        topics, stamp = self.topics, conversions.time_message(stamp_ns)
        odometry = conversions.odometry_message(
            motion, stamp, topics.frames, topics.pose_diagonal, self._twist_covariance
        )
        self._odometry.publish(odometry)
        if self._publishes_transform:
            self._transform.publish(TFMessage(transforms=[conversions.transform_message(odometry)]))
        self._joints.publish(conversions.joint_message(motion, stamp, topics.joints))
        if topics.battery and motion.battery_v is not None:
            self._battery.publish(
                conversions.battery_message(motion.battery_v, stamp, topics.frames.base)
            )

    def destroy(self) -> None:
        """Take the topics from the graph."""
        for publisher in self._publishers:
            self._node.destroy_lifecycle_publisher(publisher)
