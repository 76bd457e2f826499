"""The topics on which the node publishes the robot's motion, and their messages.

REP-103 and REP-105: x forward, counter-clockwise positive; the pose in the odometry's frame, the
twist in the robot's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any

from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState

from wheelwire import Pose
from wheelwire.log import ros_messages

from .motion_estimator import RobotMotion
from .parameter_values import Get
from .threads import NodeThreads

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # not on PyPI; every ROS installation has it
    TFMessage = None

NANOSECONDS = 1_000_000_000
DEPTH = 10
LEAST_CURRENT_A = 0.02
"""Below this, a shunt's offset decides the sign, so it is unknown whether the battery charges."""
TF_DEPTH = 100
"""The same as tf2_ros's TransformBroadcaster."""
PLANAR = (0, 1, 5)
"""Indices of x, y and yaw among x, y, z, roll, pitch, yaw."""


def frame(parameter: str, get: Get) -> str:
    """The frame that this parameter names, with the prefix."""
    return frame_prefix(get) + str(get(parameter))


def frame_prefix(get: Get) -> str:
    """Prefix of the frames' names, with a slash; empty if there is none."""
    prefix = get("tf_frame_prefix").strip("/") if get("tf_frame_prefix_enable") else ""
    return f"{prefix}/" if prefix else ""


@dataclass
class Topics:
    """Topics of a lifecycle node while its robot is open.

    Args:
        node: The lifecycle node.
        threads: The node's.
        resources: Removes the topics when it closes.
    """

    node: Any
    threads: NodeThreads
    resources: ExitStack

    def publisher(self, type_: Any, name: str, depth: int = DEPTH) -> Any:
        """A publisher that drops its messages while the node is inactive."""
        create = partial(self.node.create_lifecycle_publisher, type_, name, depth)
        return self.entity(create, self.node.destroy_lifecycle_publisher)

    def entity(self, create: Callable[[], Any], destroy: Callable[[Any], object]) -> Any:
        """An entity of the default group.

        It is created and destroyed in the general thread: rclpy's executor raises InvalidHandle
        when the event handler of a publisher is destroyed while another thread prepares to wait for
        it.
        """
        made = self.threads.general.run(create)
        self.resources.callback(self.threads.general.run, partial(destroy, made))
        return made


class MotionPublisher:
    """Publishes one robot's motion while its lifecycle node is active.

    Args:
        topics: The node's.
        get: The node's settings. The transform needs tf2_msgs; if that is missing, the log says so.
        has_battery: Whether the wheels' samples have a battery's voltage.
    """

    def __init__(self, topics: Topics, get: Get, *, has_battery: bool) -> None:
        has_transform: bool = get("enable_odom_tf")
        if has_transform and TFMessage is None:
            topics.node.get_logger().warning(
                "the node does not publish /tf: install tf2_msgs (ros-jazzy-tf2-msgs)"
            )
            has_transform = False

        self.published = 0
        """Samples published."""
        self._messages = MotionMessages(get, has_transform=has_transform)
        self._publishers = [
            topics.publisher(Odometry, "odom"),
            topics.publisher(JointState, "joint_states"),
        ]
        if has_transform:
            self._publishers.append(topics.publisher(TFMessage, "/tf", TF_DEPTH))
        self._battery = BatteryPublisher(topics, get) if has_battery else None

    def publish(self, motion: RobotMotion, stamp_ns: int | None, odom_ns: int | None) -> None:
        """Publish the motion, stamped with the time of its measurement.

        Args:
            motion: It.
            stamp_ns: Later than the one before. None: the robot sends no samples, so only odom is
                known.
            odom_ns: That of odom. None: there is a later one.
        """
        odom, *others = self._publishers
        if odom_ns is not None:
            odom.publish(self._messages.odometry(motion, odom_ns))
        if stamp_ns is None:
            return
        for publisher, message in zip(others, self._messages.fill(motion, stamp_ns), strict=True):
            publisher.publish(message)
        self.published += 1
        if self._battery is not None and motion.battery_v is not None:
            self._battery.publish(stamp_ns, motion.battery_v)


class BatteryPublisher:
    """Publishes battery_state once a second.

    Args:
        topics: The node's.
        get: The node's settings.
    """

    def __init__(self, topics: Topics, get: Get) -> None:
        self._publisher = topics.publisher(BatteryState, "battery_state")
        self._range_v = get("battery_empty_v"), get("battery_full_v")
        self._message = ros_messages.battery_state(frame("base_frame_id", get))
        self._pace = Pace(NANOSECONDS)

    def publish(self, stamp_ns: int, voltage_v: float, current_a: float | None = None) -> None:
        """Publish what was measured, unless there was something within the second."""
        if self._pace.is_due(stamp_ns):
            numbers = battery_numbers(voltage_v, *self._range_v, current_a)
            self._publisher.publish(self._message.fill(*ros_messages.stamp(stamp_ns), *numbers))


class Pace:
    """Lets one of a kind pass in a period, also after its clock went back.

    Each kind has a pace of its own: two that alternate at 50 Hz are still two in a period.

    Args:
        period: Between two of one kind, in the unit of the times.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._newest: dict[Any, float] = {}

    def is_due(self, now: float, kind: Any = None) -> bool:
        """Whether one at this time passes."""
        newest = self._newest.get(kind)
        if newest is not None and 0 <= now - newest < self._period:
            return False
        self._newest[kind] = now
        return True


class MotionMessages:
    """The messages of each sample, serialised.

    Building a ROS message in Python and converting it to C costs several times what its publication
    costs. So each is laid out once, and its numbers are filled in.

    Args:
        get: The node's settings.
        has_transform: Whether there is a message for /tf.
    """

    def __init__(self, get: Get, *, has_transform: bool) -> None:
        self._frames = frame("odom_frame_id", get), frame("base_frame_id", get)
        self._pose_diagonal: Sequence[float] = get("pose_covariance_diagonal")
        self._twist_diagonal: Sequence[float] = get("twist_covariance_diagonal")
        left, right = get("left_wheel_names"), get("right_wheel_names")
        self._wheels = len(left), len(right)
        self._odometry = ros_messages.odometry(*self._frames, self._twist_diagonal)
        self._joints = ros_messages.joint_state([*left, *right])
        self._transform = ros_messages.transforms(*self._frames) if has_transform else None

    def odometry(self, motion: RobotMotion, stamp_ns: int) -> bytes:
        """The nav_msgs/Odometry."""
        template = self._odometry
        if motion.twist_variances is not None:
            diagonal = list(self._twist_diagonal)
            for index, variance in zip((0, 5), motion.twist_variances, strict=True):
                diagonal[index] = max(diagonal[index], variance)
            template = ros_messages.odometry(*self._frames, diagonal)
        covariance = pose_covariance(motion.covariance, self._pose_diagonal)
        stamp = ros_messages.stamp(stamp_ns)
        return template.fill(*stamp, *planar(motion.pose), *covariance, *motion.twist)

    def fill(self, motion: RobotMotion, stamp_ns: int) -> Iterator[bytes]:
        """The sensor_msgs/JointState and, if asked for, the TFMessage."""
        stamp = ros_messages.stamp(stamp_ns)
        left, right = self._wheels
        wheels = [motion.left] * left + [motion.right] * right
        yield self._joints.fill(
            *stamp,
            *[wheel.angle_rad for wheel in wheels],
            *[wheel.velocity_radps for wheel in wheels],
        )
        if self._transform is not None:
            yield self._transform.fill(*stamp, *planar(motion.pose))


def planar(pose: Pose) -> tuple[float, float, float, float]:
    """X and y, and z and w of the orientation."""
    # The heading need not be wrapped: a full turn changes both signs, which is the same rotation.
    half_rad = pose.heading_rad / 2
    return pose.x_m, pose.y_m, math.sin(half_rad), math.cos(half_rad)


def time_ns(message: Time) -> int:
    """Convert a time message to nanoseconds; an empty one is 0."""
    return int(message.sec) * NANOSECONDS + int(message.nanosec)


def pose_covariance(planar: Any, base_diagonal: Sequence[float]) -> list[float]:
    """ROS's 6 by 6 covariance matrix, row by row.

    Args:
        planar: Covariance of (x, y, heading), 3 by 3.
        base_diagonal: Variances to add, for errors that dead reckoning does not model.
    """
    matrix = [0.0] * 36
    matrix[::7] = base_diagonal
    # Lists of floats: taking single numbers out of an array costs more than the sums.
    for row, values in zip(PLANAR, planar.tolist(), strict=True):
        for column, value in zip(PLANAR, values, strict=True):
            matrix[6 * row + column] += value
    return matrix


def battery_numbers(
    voltage_v: float, empty_v: float, full_v: float, current_a: float | None = None
) -> tuple[float, float, float, int]:
    """What fills a battery's message; what is not measured is NaN, or unknown.

    Args:
        voltage_v: [V]
        empty_v: The voltage that is 0 %; NaN: unknown. [V]
        full_v: The voltage that is 100 %; NaN: unknown. [V]
        current_a: Drawn from it; None: nothing measures it. [A]
    """
    share = (voltage_v - empty_v) / (full_v - empty_v)
    if not math.isnan(share):
        share = min(max(share, 0.0), 1.0)  # ROS's "percentage" is 0 to 1
    charging_a = math.nan if current_a is None else -current_a  # ROS: negative when discharging
    status = BatteryState.POWER_SUPPLY_STATUS_UNKNOWN
    if charging_a >= LEAST_CURRENT_A:
        status = BatteryState.POWER_SUPPLY_STATUS_CHARGING
    elif charging_a <= -LEAST_CURRENT_A:
        status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    return voltage_v, charging_a, share, status
