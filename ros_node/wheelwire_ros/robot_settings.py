"""Conversion of the node's parameters to settings of its parts. Needs no rclpy."""

from __future__ import annotations

import math
from dataclasses import fields

from wheelwire import InvalidArgument

from .commands import AUTO, COMMAND_TYPES
from .connection import Tuning
from .conversions import Frames
from .parameter_checks import Get
from .publishers import MotionTopics
from .speed_limiter import AxisLimits, Limits


def tuning(get: Get) -> Tuning:
    """The settings that can change while the robot is open."""
    max_rpm = get("max_rpm")
    return Tuning(
        limits=Limits(_limits("linear.x", get), _limits("angular.z", get)),
        max_wheel_radps=math.inf if math.isnan(max_rpm) else max_rpm * 2 * math.pi / 60,
        separation_multiplier=get("wheel_separation_multiplier"),
        left_radius_multiplier=get("left_wheel_radius_multiplier"),
        right_radius_multiplier=get("right_wheel_radius_multiplier"),
        rearm_gap_s=get("rearm_gap_s") or 0.0,  # None before the robot is open
    )


def command_type(get: Get) -> str:
    """The type of cmd_vel, or `AUTO`; raises `InvalidArgument`."""
    name = str(get("cmd_vel_type"))
    if name != AUTO and name not in COMMAND_TYPES:
        choices = ", ".join((*COMMAND_TYPES, AUTO))
        raise InvalidArgument(f"cmd_vel_type = {name!r}: give one of {choices}")
    return "TwistStamped" if name == AUTO and get("use_stamped_vel") else name


def frames(get: Get) -> Frames:
    """The frames' names, with the prefix and a slash if there is one."""
    prefix = get("tf_frame_prefix").strip("/") if get("tf_frame_prefix_enable") else ""
    names = get("odom_frame_id"), get("base_frame_id")
    return Frames(*(f"{prefix}/{name}" if prefix else name for name in names))


def topics(get: Get, *, has_battery: bool) -> MotionTopics:
    """The settings of what is published."""
    return MotionTopics(
        frames=frames(get),
        joints=(tuple(get("left_wheel_names")), tuple(get("right_wheel_names"))),
        transform=get("enable_odom_tf"),
        battery=has_battery,
        battery_range_v=(get("battery_empty_v"), get("battery_full_v")),
        pose_diagonal=get("pose_covariance_diagonal"),
        twist_diagonal=get("twist_covariance_diagonal"),
    )


def _limits(axis: str, get: Get) -> AxisLimits:
    return AxisLimits(**{field.name: get(f"{axis}.{field.name}") for field in fields(AxisLimits)})
