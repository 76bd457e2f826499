"""cmd_vel: passes velocity commands to the robot."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped

from . import conversions
from .commands import AUTO, COMMAND_TYPES, CommandIgnored, Ignored, command_age_s
from .connection import RobotConnection
from .lifecycle import steady_clock
from .publishers import LimitedVelocityPublisher
from .threads import NodeThreads

TOPIC = "cmd_vel"
DEPTH = 1
"""Only the newest command matters."""
LOG_PERIOD_S = 5.0
LOOK_PERIOD_S = 0.2
"""How often it is looked who publishes. rclpy does not tell when somebody begins to."""
PACKAGE = "geometry_msgs/msg/"
TYPES = dict(zip(COMMAND_TYPES, (Twist, TwistStamped), strict=True))


class CommandSubscriber:
    """Sends each command to the robot as it arrives, or counts why not.

    DDS drops messages of another type than the subscriber's without a word. So the type is the one
    that is published, and a second one is an error in the log.

    Args:
        node: An rclpy node.
        connection: The connection to the robot.
        threads: The node's; all of this runs in the thread of the urgent callbacks.
        prepare: Called when a command meets a session that is not prepared.
        type_name: `Twist`, `TwistStamped`, or `auto`: whatever the first publisher publishes.
        limited: Publishes each command that is obeyed, as limited; None for not at all.
    """

    def __init__(
        self,
        node: Any,
        connection: RobotConnection,
        threads: NodeThreads,
        prepare: Callable[[], None],
        type_name: str,
        limited: LimitedVelocityPublisher | None = None,
    ) -> None:
        self._limited = limited
        self._node = node
        self._connection = connection
        self._threads = threads
        self._prepare = prepare
        self._is_fixed = type_name != AUTO
        self._type = ""
        self._subscription: Any = None
        self._others: list[str] = []
        self._last: Ignored | None = None
        """Why the last command was not obeyed."""
        self._told_clears = -1
        """The number of clears when it was last said that the robot waits for a zero command."""
        self._topic = node.resolve_topic_name(TOPIC)
        threads.run_urgently(lambda: self._begin(type_name))

    def ignored_types(self) -> list[str]:
        """Other message types published on this topic."""
        return self._others

    def destroy(self) -> None:
        """Remove the subscription."""
        self._threads.run_urgently(self._end)

    def _begin(self, type_name: str) -> None:
        if self._is_fixed:
            self._subscribe(type_name)
        self._timer = self._node.create_timer(
            LOOK_PERIOD_S, self._look, callback_group=self._threads.urgent, clock=steady_clock()
        )
        self._look()

    def _end(self) -> None:
        self._node.destroy_timer(self._timer)
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)

    def _look(self) -> None:
        """Follow what is published on the topic."""
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        types = [publisher.topic_type for publisher in publishers]
        # A type is kept as long as anybody publishes it: two publishers must not alternate.
        if not self._is_fixed and self._type not in types:
            known = [name for name in TYPES if PACKAGE + name in types]
            if known:
                self._subscribe(known[0])
        others = sorted(set(types) - {self._type})
        if others != self._others:
            self._others = others
            if others and self._type:
                self._node.get_logger().error(
                    f"{self._topic}: messages of type {', '.join(others)} are dropped, because the "
                    f"node takes {self._type}: have all publishers publish one type, or set "
                    "cmd_vel_type"
                )

    def _subscribe(self, type_name: str) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        callback = self._on_stamped_twist if type_name == "TwistStamped" else self._on_twist
        self._subscription = self._node.create_subscription(
            TYPES[type_name], TOPIC, callback, DEPTH, callback_group=self._threads.urgent
        )
        self._type = PACKAGE + type_name
        self._node.get_logger().info(f"{self._topic} is {self._type}")

    def _on_stamped_twist(self, message: TwistStamped, info: dict[str, int]) -> None:
        self._obey(message.twist, conversions.time_ns(message.header.stamp), info)

    def _on_twist(self, message: Twist, info: dict[str, int]) -> None:
        self._obey(message, None, info)

    def _obey(self, twist: Twist, stamp_ns: int | None, info: dict[str, int]) -> None:
        age_s = command_age_s(stamp_ns, self._node.get_clock().now().nanoseconds, _waited_ns(info))
        try:
            # On the monotonic clock from here on, so that setting a clock extends no command.
            obeyed = self._connection.command(conversions.twist_of(twist), time.monotonic() - age_s)
            if self._limited is not None:
                self._limited.publish(obeyed)
        except CommandIgnored as ignored:
            self._connection.gate.count(ignored)
            self._log(ignored)
            # Perhaps the session is a new one; does nothing if it is prepared.
            self._prepare()
        else:
            self._last = None

    def _log(self, ignored: CommandIgnored) -> None:
        """At once if the reason is another one than the last command's, else now and then."""
        logger = self._node.get_logger()
        if ignored.reason is Ignored.UNARMED:
            self._log_once_per_clear(ignored)
        elif ignored.reason is not self._last:
            self._last = ignored.reason
            logger.warning(str(ignored))
        else:
            # A call of its own: rclpy throttles by the line of code.
            logger.warning(str(ignored), throttle_duration_sec=LOG_PERIOD_S)

    def _log_once_per_clear(self, ignored: CommandIgnored) -> None:
        """Some of these commands count as sent, because their refusal is told by the next one."""
        if self._told_clears != self._connection.clears:
            self._told_clears = self._connection.clears
            self._node.get_logger().warning(str(ignored))


def _waited_ns(info: dict[str, int]) -> int:
    """Time since the message was received, by the wall clock; the middleware may give 0."""
    received_ns = info["received_timestamp"]
    return time.time_ns() - received_ns if received_ns else 0
