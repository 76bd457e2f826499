"""`cmd_vel`: its message type, the age of each command, and what the log says of ignored ones."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Set
from dataclasses import dataclass
from functools import partial
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy

import wheelwire

from .parameter_values import Get
from .publishers import DEPTH, Pace, Topics, frame, time_ns
from .robot_connection import CommandIgnored, Ignored, RobotConnection
from .threads import steady_clock
from .time_base import TimeBase

TOPIC = "cmd_vel"
LIMITED_TOPIC = "~/cmd_vel_out"
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Only the newest command matters. A best-effort subscription hears every publisher, a reliable
one only reliable publishers. The next command replaces a lost one; DDS sends nothing again late."""
LOG_PERIOD_S = 5.0
LOOK_PERIOD_S = 0.2
"""How often the node looks for publishers. rclpy does not report new ones."""
CHANCE_S = 1.0
"""While silent publishers of both types are there, the node listens to each type for this long."""
PACKAGE = "geometry_msgs/msg/"
PLAIN, STAMPED = "Twist", "TwistStamped"
TYPES = {PLAIN: Twist, STAMPED: TwistStamped}
AUTO = "auto"
"""A type's name that means the type of the first message."""


def command_type(get: Get) -> str:
    """The type of cmd_vel, or `AUTO`."""
    name = str(get("cmd_vel_type"))
    return STAMPED if name == AUTO and get("use_stamped_vel") else name


class CommandType:
    """Decides which message type the node listens to. Pure: the time is an argument.

    With `auto` the node listens to Twist until a publisher of TwistStamped appears. The first
    message decides, not the first publisher, which may be an idle joystick. When the last publisher
    of the decided type is gone, the next message decides again.

    Args:
        wanted: `Twist`, `TwistStamped` or `auto`.
    """

    def __init__(self, wanted: str) -> None:
        self._is_fixed = wanted != AUTO
        self.name = wanted if self._is_fixed else PLAIN
        """The type to subscribe to now."""
        self.is_decided = self._is_fixed
        """Whether the type is fixed, whatever else is published."""
        self._chance_ends_s = -math.inf

    def decide(self) -> bool:
        """Note a message of the present type; whether that message decided the type."""
        decides = not self.is_decided
        self.is_decided = True
        return decides

    def look(self, published: Set[str], now_s: float) -> bool:
        """Note which publishers are there now; whether `name` has changed.

        Args:
            published: The published types that the node can listen to.
            now_s: On a monotonic clock.
        """
        if self._is_fixed or (self.is_decided and self.name in published):
            return False
        self.is_decided = False
        other = STAMPED if self.name == PLAIN else PLAIN
        if other not in published or (self.name in published and now_s < self._chance_ends_s):
            return False
        self.name = other
        self._chance_ends_s = now_s + CHANCE_S
        return True


def command_age_s(stamp_ns: int | None, now_ns: int, waited_ns: int, rate: float = 1.0) -> float:
    """A command's age in seconds: since its stamp, but at least since it was received.

    So a sender whose clock is ahead does not make its commands valid for longer.

    Args:
        stamp_ns: From the message's header; None or 0: use the time of reception.
        now_ns: The current time on the clock of the stamps.
        waited_ns: Time since this computer received it.
        rate: How fast that clock runs; a command lives in real time.
    """
    since_stamped_ns = (now_ns - stamp_ns) / rate if stamp_ns else 0
    # At least 0: somebody may have set back the clock that measured the wait.
    return max(0, waited_ns, since_stamped_ns) / 1e9


@dataclass
class CommandSubscriber:
    """Sends each command to the robot as it arrives, or counts why not.

    DDS silently drops messages of another type than the subscriber's, and allows one type for each
    topic and participant. So there is one subscription at a time, of the type that `CommandType`
    decides; the log reports publishers of the other type as an error.

    Args:
        topics: The node's; all of this runs in the thread of the urgent callbacks.
        connection: The connection to the robot.
        prepare: Called when a command meets a session that is not prepared.
        clock: Converts between the ROS clock and the monotonic one.
        get: The node's settings.
    """

    topics: Topics
    connection: RobotConnection
    prepare: Callable[[], None]
    clock: TimeBase
    get: Get

    def __post_init__(self) -> None:
        topics = self.topics
        self.ignored_types: list[str] = []
        """Other message types that somebody publishes on this topic."""
        self._node = topics.node
        self._urgent = topics.threads.urgent_group
        self._type = CommandType(command_type(self.get))
        self._subscription: Any = None
        self._pace = Pace(LOG_PERIOD_S)
        self._logged_holds = 0
        """`RobotConnection.holds` when the log last said that the robot waits for a zero."""
        self._topic = self._node.resolve_topic_name(TOPIC)
        self._frame = frame("base_frame_id", self.get)
        self._limited: Any = None
        if self.get("publish_limited_velocity"):
            create = partial(self._node.create_publisher, TwistStamped, LIMITED_TOPIC, DEPTH)
            self._limited = topics.entity(create, self._node.destroy_publisher)
        topics.threads.urgent.run(self._begin)
        topics.resources.callback(topics.threads.urgent.run, self._end)

    def _begin(self) -> None:
        self._timer = self._node.create_timer(
            LOOK_PERIOD_S, self._look, callback_group=self._urgent, clock=steady_clock()
        )
        self._subscribe()
        if self._type.is_decided:
            self._node.get_logger().info(f"{self._topic} is {PACKAGE}{self._type.name}")
        self._look()

    def _end(self) -> None:
        self._node.destroy_timer(self._timer)
        self._node.destroy_subscription(self._subscription)

    def _look(self) -> None:
        """Find the topic's publishers."""
        publishers = self._node.get_publishers_info_by_topic(self._topic)
        types = {publisher.topic_type for publisher in publishers}
        known = {name for name in TYPES if PACKAGE + name in types}
        if self._type.look(known, time.monotonic()):
            self._subscribe()
        # While the type is undecided, the node listens to both alternately: it drops none for good.
        dropped = types - {PACKAGE + self._type.name} if self._type.is_decided else set()
        others = sorted(dropped)
        if others != self.ignored_types:
            self.ignored_types = others
            if others and self._pace.is_due(time.monotonic(), tuple(others)):
                self._node.get_logger().error(
                    f"{self._topic}: DDS drops messages of type {', '.join(others)}, because the "
                    f"node listens to {PACKAGE}{self._type.name}: have all publishers publish one "
                    "type, or set cmd_vel_type"
                )

    def _subscribe(self) -> None:
        if self._subscription is not None:
            self._node.destroy_subscription(self._subscription)
        self._subscription = self._node.create_subscription(
            TYPES[self._type.name], TOPIC, self._obey, NEWEST, callback_group=self._urgent
        )

    def _obey(self, message: Any, info: dict[str, int]) -> None:
        twist, stamp_ns = message, None
        if isinstance(message, TwistStamped):
            twist, stamp_ns = message.twist, time_ns(message.header.stamp)
        if self._type.decide():
            self._node.get_logger().info(
                f"{self._topic} is {PACKAGE}{self._type.name}: its first message decided"
            )
        now_ns, received_ns = self._node.get_clock().now().nanoseconds, info["received_timestamp"]
        # By the wall clock. 0: the middleware does not report it.
        waited_ns = time.time_ns() - received_ns if received_ns else 0
        age_s = command_age_s(stamp_ns, now_ns, waited_ns, self.clock.rate)
        try:
            # On the monotonic clock from here on, so that setting a clock extends no command.
            obeyed = self.connection.command(
                wheelwire.Twist(twist.linear.x, twist.angular.z), time.monotonic() - age_s
            )
        except CommandIgnored as ignored:
            self.connection.ignored[ignored.reason] += 1
            self._log(ignored)
            # Perhaps the session is a new one; does nothing if it is prepared.
            self.prepare()
        else:
            self._publish_limited(obeyed)

    def _publish_limited(self, obeyed: wheelwire.Twist) -> None:
        if self._limited is not None:
            message = TwistStamped()
            message.header.stamp = self._node.get_clock().now().to_msg()
            message.header.frame_id = self._frame
            message.twist.linear.x, message.twist.angular.z = obeyed
            self._limited.publish(message)

    def _log(self, ignored: CommandIgnored) -> None:
        if ignored.reason is Ignored.UNARMED:
            # Once. The node counts some of these commands as sent, because the robot reports their
            # refusal only with the next one.
            is_due = self._logged_holds != self.connection.holds
            self._logged_holds = self.connection.holds
        else:
            is_due = self._pace.is_due(time.monotonic(), ignored.reason)
        if is_due:
            self._node.get_logger().warning(str(ignored))
