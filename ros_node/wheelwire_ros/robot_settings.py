"""What the node's parameters mean to the parts that it is made of. Needs no rclpy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .connection import Tuning
from .conversions import Frames
from .publishers import MotionTopics

Get = Callable[[str], Any]
"""A parameter's value by its name."""


def tuning(get: Get) -> Tuning:
    """What can change while the robot is open."""
    return Tuning(
        max_linear_mps=get("linear.x.max_velocity"),
        max_angular_radps=get("angular.z.max_velocity"),
        separation_multiplier=get("wheel_separation_multiplier"),
        left_radius_multiplier=get("left_wheel_radius_multiplier"),
        right_radius_multiplier=get("right_wheel_radius_multiplier"),
    )


def frames(get: Get) -> Frames:
    """With the prefix, if there is one, and one slash after it."""
    prefix = get("tf_frame_prefix").strip("/")
    names = get("odom_frame_id"), get("base_frame_id")
    return Frames(*(f"{prefix}/{name}" if prefix else name for name in names))


def topics(get: Get, *, has_battery: bool) -> MotionTopics:
    """What is published."""
    return MotionTopics(
        frames=frames(get),
        joints=(get("left_wheel_name"), get("right_wheel_name")),
        transform=get("enable_odom_tf"),
        battery=has_battery,
        pose_diagonal=get("pose_covariance_diagonal"),
        twist_diagonal=get("twist_covariance_diagonal"),
    )
