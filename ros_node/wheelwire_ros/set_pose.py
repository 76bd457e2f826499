"""`~/set_pose`: somebody tells where the robot is."""

from __future__ import annotations

import math
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped

from wheelwire import Pose

from . import conversions
from .estimator import MotionEstimator
from .threads import NodeThreads

TOPIC = "~/set_pose"
DEPTH = 1


class PoseSetter:
    """Sets the pose of the odometry to that of each message, covariance included.

    Args:
        node: An rclpy node.
        threads: The node's.
        estimator: Whose pose it is.
        frame: The odometry's: a pose in another one cannot be converted here.
    """

    def __init__(
        self, node: Any, threads: NodeThreads, estimator: MotionEstimator, frame: str
    ) -> None:
        self._node = node
        self._threads = threads
        self._estimator = estimator
        self._frame = frame
        threads.run_generally(self._create)

    def _create(self) -> None:
        self._subscription = self._node.create_subscription(
            PoseWithCovarianceStamped, TOPIC, self._on_pose, DEPTH
        )

    def destroy(self) -> None:
        """Remove the topic."""
        self._threads.run_generally(lambda: self._node.destroy_subscription(self._subscription))

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        logger = self._node.get_logger()
        frame = message.header.frame_id
        if frame not in {"", self._frame}:
            logger.warning(f"{TOPIC} ignored: it is in {frame}; give the pose in {self._frame}")
            return
        try:
            pose = conversions.planar_pose(message.pose.pose)
            covariance = conversions.planar_covariance(message.pose.covariance)
        except ValueError as error:
            logger.warning(f"{TOPIC} ignored: {error}")
            return
        self._estimator.set_pose(pose, covariance)
        logger.info(f"the pose was set to {words(pose)}")


def words(pose: Pose) -> str:
    """A pose for a person."""
    return f"x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, {math.degrees(pose.heading_rad):.1f} degrees"
