"""cmd_vel: passes velocity commands to the robot."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped

from . import conversions
from .command_type import CommandType
from .commands import COMMAND_TYPES, CommandIgnored, Ignored, LogPace, command_age_s
from .connection import RobotConnection
from .lifecycle import steady_clock
from .publishers import LimitedVelocityPublisher
from .qos import NEWEST
from .threads import NodeThreads
from .time_base import TimeBase

TOPIC = "cmd_vel"
LOG_PERIOD_S = 5.0
LOOK_PERIOD_S = 0.2
"""How often it is looked who publishes. rclpy does not tell when somebody begins to."""
PACKAGE = "geometry_msgs/msg/"
TYPES = dict(zip(COMMAND_TYPES, (Twist, TwistStamped), strict=True))


class CommandSubscriber:
    """Sends each command to the robot as it arrives, or counts why not.

    DDS drops messages of another type than the subscriber's without a word, and takes one type a
    topic and participant. So there is one subscription at a time, and `CommandType` says of which
    type; a second type that is published is an error in the log.

    Args:
        node: An rclpy node.
        connection: The connection to the robot.
        threads: The node's; all of this runs in the thread of the urgent callbacks.
        prepare: Called when a command meets a session that is not prepared.
        type_name: `Twist`, `TwistStamped`, or `auto`: of whichever type the first message is.
        clock: Converts between the ROS clock and the monotonic one.
        limited: Publishes each command that is obeyed, as limited; None for not at all.
    """

    def __init__(
        self,
        node: Any,
        connection: RobotConnection,
        threads: NodeThreads,
        prepare: Callable[[], None],
        type_name: str,
        clock: TimeBase,
        limited: LimitedVelocityPublisher | None = None,
    ) -> None:
        self._limited = limited
        self._node = node
        self._connection = connection
        self._threads = threads
        self._prepare = prepare
        self._clock = clock
        self._type = CommandType(type_name)
        self._subscription: Any = None
        self._others: list[str] = []
        self._pace = LogPace(LOG_PERIOD_S)
        self._told_clears = -1
        """The number of clears when it was last said that the robot waits for a zero command."""
        self._topic = node.resolve_topic_name(TOPIC)
        threads.run_urgently(self._begin)

    def ignored_types(self) -> list[str]:
        """Other message types published on this topic."""
        return self._others

    def destroy(self) -> None:
        """Remove the subscription."""
        self._threads.run_urgently(self._end)

    def _begin(self) -> None:
        self._timer = self._node.create_timer(
            LOOK_PERIOD_S, self._look, callback_group=self._threads.urgent, clock=steady_clock()
        )
        self._subscribe()
        if self._type.is_decided:
            self._node.get_logger().info(f"{self._topic} is {PACKAGE}{self._type.name}")
        self._look()

    def _end(self) -> None:
        self._node.destroy_timer(self._timer)
        self._node.destroy_subscription(self._subscription)

    def _look(self) -> None:
        """Follow what is published on the topic."""
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        types = {publisher.topic_type for publisher in publishers}
        known = {name for name in TYPES if PACKAGE + name in types}
        if self._type.look(known, time.monotonic()):
            self._subscribe()
        # While it is open which of two types is taken, none is dropped for good.
        dropped = types - {PACKAGE + self._type.name} if self._type.is_decided else set()
        others = sorted(dropped)
        if others != self._others:
            self._others = others
            if others and self._pace.is_due(tuple(others), time.monotonic()):
                self._node.get_logger().error(
                    f"{self._topic}: messages of type {', '.join(others)} are dropped, because the "
                    f"node takes {PACKAGE}{self._type.name}: have all publishers publish one type, "
                    "or set cmd_vel_type"
                )

    def _subscribe(self) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        name = self._type.name
        callback = self._on_stamped_twist if name == "TwistStamped" else self._on_twist
        self._subscription = self._node.create_subscription(
            TYPES[name], TOPIC, callback, NEWEST, callback_group=self._threads.urgent
        )

    def _on_stamped_twist(self, message: TwistStamped, info: dict[str, int]) -> None:
        self._obey(message.twist, conversions.time_ns(message.header.stamp), info)

    def _on_twist(self, message: Twist, info: dict[str, int]) -> None:
        self._obey(message, None, info)

    def _obey(self, twist: Twist, stamp_ns: int | None, info: dict[str, int]) -> None:
        if self._type.decide():
            self._node.get_logger().info(
                f"{self._topic} is {PACKAGE}{self._type.name}: its first message decided"
            )
        now_ns, waited_ns = self._node.get_clock().now().nanoseconds, _waited_ns(info)
        age_s = command_age_s(stamp_ns, now_ns, waited_ns, self._clock.rate)
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

    def _log(self, ignored: CommandIgnored) -> None:
        """Each reason at once, and then now and then."""
        if ignored.reason is Ignored.UNARMED:
            self._log_once_per_clear(ignored)
        elif self._pace.is_due(ignored.reason, time.monotonic()):
            self._node.get_logger().warning(str(ignored))

    def _log_once_per_clear(self, ignored: CommandIgnored) -> None:
        """Some of these commands count as sent, because their refusal is told by the next one."""
        if self._told_clears != self._connection.clears:
            self._told_clears = self._connection.clears
            self._node.get_logger().warning(str(ignored))


def _waited_ns(info: dict[str, int]) -> int:
    """Time since the message was received, by the wall clock; the middleware may give 0."""
    received_ns = info["received_timestamp"]
    return time.time_ns() - received_ns if received_ns else 0
