"""Conversion between Wheelwire's values and ROS messages. Needs the message packages, not rclpy.

REP-103 and REP-105: x forward, counter-clockwise positive; the pose in the odometry's frame, the
twist in the robot's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Quaternion, TransformStamped, TwistStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState

from wheelwire import Pose, Twist

from .estimator import RobotMotion

NANOSECONDS = 1_000_000_000
LOOSE = 1e-3
"""What rounding may do to a quaternion that somebody typed."""
PLANAR = (0, 1, 5)
"""Indices of x, y and yaw among x, y, z, roll, pitch, yaw."""


class Frames(NamedTuple):
    """The names of the frames, prefix included."""

    odom: str
    base: str


def time_message(stamp_ns: int) -> Time:
    """Convert nanoseconds since the epoch to a message."""
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    return Time(sec=seconds, nanosec=nanoseconds)


def time_ns(message: Time) -> int:
    """Convert a time message to nanoseconds; 0 if it was left empty."""
    return int(message.sec) * NANOSECONDS + int(message.nanosec)


def limited_message(twist: Twist, stamp: Time, frame: str) -> TwistStamped:
    """A velocity of the body in the robot's frame."""
    message = TwistStamped()
    message.header.stamp = stamp
    message.header.frame_id = frame
    message.twist.linear.x = twist.linear_mps
    message.twist.angular.z = twist.angular_radps
    return message


def twist_of(message: Any) -> Twist:
    """The two components of a geometry_msgs/Twist that a differential drive can obey."""
    return Twist(message.linear.x, message.angular.z)


def heading_quaternion(heading_rad: float) -> Quaternion:
    """The quaternion of a rotation about z."""
    # The heading need not be wrapped: a full turn changes both signs, which is the same rotation.
    return Quaternion(z=math.sin(heading_rad / 2), w=math.cos(heading_rad / 2))


def planar_pose(pose: Any) -> Pose:
    """The place and the heading of a geometry_msgs/Pose.

    Raises:
        ValueError: It is none of a robot on a floor.
    """
    x, y, z, w = (getattr(pose.orientation, axis) for axis in "xyzw")
    numbers = (pose.position.x, pose.position.y, x, y, z, w)
    if not all(map(math.isfinite, numbers)):
        raise ValueError("a number is not finite")
    if abs(x * x + y * y + z * z + w * w - 1) > LOOSE:
        raise ValueError("the orientation is no unit quaternion; no turn is x, y, z = 0, w = 1")
    if max(abs(x), abs(y)) > LOOSE:
        raise ValueError("it rolls or pitches; the odometry is that of a floor")
    return Pose(pose.position.x, pose.position.y, 2 * math.atan2(z, w))


def planar_covariance(covariance: Sequence[float]) -> Any:
    """Of (x, y, heading), 3 by 3, from ROS's 6 by 6.

    Raises:
        ValueError: It is no covariance.
    """
    matrix = np.asarray(covariance, dtype=np.float64).reshape(6, 6)[np.ix_(PLANAR, PLANAR)]
    if not np.all(np.isfinite(matrix)):
        raise ValueError("a covariance is not finite")
    if not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix)[0] < -LOOSE:
        raise ValueError("the covariance of x, y and yaw is not symmetrical, or below 0")
    return matrix


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


def diagonal(values: Sequence[float]) -> Any:
    """ROS's 6 by 6 covariance matrix, row by row, with these variances on its diagonal."""
    return np.diag(np.asarray(values, dtype=np.float64)).reshape(36)


def odometry_message(
    motion: RobotMotion,
    stamp: Time,
    frames: Frames,
    pose_diagonal: Sequence[float],
    twist_covariance: Any,
) -> Odometry:
    """The robot's pose in the odometry's frame and its twist in its own frame."""
    message = Odometry(child_frame_id=frames.base)
    message.header.stamp = stamp
    message.header.frame_id = frames.odom
    position = message.pose.pose.position
    position.x, position.y = motion.pose.x_m, motion.pose.y_m
    message.pose.pose.orientation = heading_quaternion(motion.pose.heading_rad)
    message.pose.covariance = pose_covariance(motion.covariance, pose_diagonal)
    message.twist.twist.linear.x = motion.twist.linear_mps
    message.twist.twist.angular.z = motion.twist.angular_radps
    message.twist.covariance = twist_covariance
    return message


def transform_message(odometry: Odometry) -> TransformStamped:
    """The same pose as a transform from the odometry's frame to the robot's."""
    message = TransformStamped(header=odometry.header, child_frame_id=odometry.child_frame_id)
    position = odometry.pose.pose.position
    translation = message.transform.translation
    translation.x, translation.y = position.x, position.y
    message.transform.rotation = odometry.pose.pose.orientation
    return message


def joint_message(
    motion: RobotMotion, stamp: Time, names: tuple[Sequence[str], Sequence[str]]
) -> JointState:
    """The angle and velocity of all wheels; those of one side turn together."""
    left, right = names
    wheels = [motion.left] * len(left) + [motion.right] * len(right)
    message = JointState(name=[*left, *right])
    message.header.stamp = stamp
    message.position = [wheel.angle_rad for wheel in wheels]
    message.velocity = [wheel.velocity_radps for wheel in wheels]
    return message


def charge_share(voltage_v: float, empty_v: float, full_v: float) -> float:
    """What ROS calls percentage, 0 to 1, on a straight line between two voltages; or NaN."""
    share = (voltage_v - empty_v) / (full_v - empty_v)
    return share if math.isnan(share) else min(max(share, 0.0), 1.0)


def battery_message(
    voltage_v: float, stamp: Time, frame: str, empty_v: float, full_v: float
) -> BatteryState:
    """A battery of which only the voltage is measured; everything else says that it is unknown.

    Args:
        voltage_v: [V]
        stamp: When it was measured.
        frame: The robot's.
        empty_v: The voltage that is 0 %; NaN if that is not known. [V]
        full_v: The voltage that is 100 %. [V]
    """
    unknown = math.nan
    message = BatteryState(
        power_supply_status=BatteryState.POWER_SUPPLY_STATUS_UNKNOWN,
        power_supply_health=BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN,
        power_supply_technology=BatteryState.POWER_SUPPLY_TECHNOLOGY_UNKNOWN,
        voltage=voltage_v,
        temperature=unknown,
        current=unknown,
        charge=unknown,
        capacity=unknown,
        design_capacity=unknown,
        percentage=charge_share(voltage_v, empty_v, full_v),
        present=True,
    )
    message.header.stamp = stamp
    message.header.frame_id = frame
    return message
