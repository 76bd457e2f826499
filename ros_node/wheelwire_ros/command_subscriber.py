"""cmd_vel: passes velocity commands to the robot."""

from __future__ import annotations

import time
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped

from . import conversions
from .commands import CommandIgnored, command_age_s
from .connection import RobotConnection

TOPIC = "cmd_vel"
DEPTH = 1
"""Only the newest command matters."""
LOG_PERIOD_S = 1.0


class CommandSubscriber:
    """Sends each command to the robot as it arrives, or counts why not.

    Args:
        node: An rclpy node.
        connection: The connection to the robot.
        stamped: Whether the topic is a TwistStamped rather than a Twist.
    """

    def __init__(self, node: Any, connection: RobotConnection, *, stamped: bool) -> None:
        self._node = node
        self._connection = connection
        type_, callback = (
            (TwistStamped, self._on_stamped_twist) if stamped else (Twist, self._on_twist)
        )
        self._type_name = f"geometry_msgs/msg/{type_.__name__}"
        self._subscription = node.create_subscription(type_, TOPIC, callback, DEPTH)
        self._topic = self._subscription.topic_name
        node.get_logger().info(f"{self._topic} is {self._type_name} (parameter use_stamped_vel)")

    def ignored_types(self) -> list[str]:
        """Other message types published on this topic, which the middleware silently drops."""
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        return sorted({publisher.topic_type for publisher in publishers} - {self._type_name})

    def destroy(self) -> None:
        """Remove the subscription."""
        self._node.destroy_subscription(self._subscription)

    def _on_stamped_twist(self, message: TwistStamped, info: dict[str, int]) -> None:
        self._obey(message.twist, conversions.time_ns(message.header.stamp), info)

    def _on_twist(self, message: Twist, info: dict[str, int]) -> None:
        self._obey(message, None, info)

    def _obey(self, twist: Twist, stamp_ns: int | None, info: dict[str, int]) -> None:
        age_s = command_age_s(stamp_ns, self._node.get_clock().now().nanoseconds, _waited_ns(info))
        try:
            self._connection.command(conversions.twist_of(twist), time.monotonic() - age_s)
        except CommandIgnored as ignored:
            self._connection.gate.count(ignored)
            self._node.get_logger().warning(str(ignored), throttle_duration_sec=LOG_PERIOD_S)


def _waited_ns(info: dict[str, int]) -> int:
    """Time since the message was received, by the wall clock; the middleware may give 0."""
    received_ns = info["received_timestamp"]
    return time.time_ns() - received_ns if received_ns else 0
