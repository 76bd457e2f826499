"""The node's parameters: their names, aliases, types, ranges and descriptions.

Two kinds. The node's own have a default. The robot's are the firmware's, by its names: one that is
not given is not set until the robot is open, and then shows the value that the robot has.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter as RosParameter

from wheelwire_protocol.parameters import PARAMETER_BY_NAME, Kind, Parameter

Value = bool | int | float | str | list[float]

NOT_OFFERED = {"stream_rate_hz"}
"""Parameters of the firmware that the node sets itself, from publish_rate."""
ROBOT_PARAMETERS = {n: p for n, p in PARAMETER_BY_NAME.items() if n not in NOT_OFFERED}


@dataclass(frozen=True)
class Setting:
    """One of the node's own parameters.

    Attributes:
        live: Whether it can change while the robot is open.
        low: Lower bound, inclusive; NaN for none.
        high: Upper bound, likewise.
    """

    name: str
    default: Value
    doc: str
    low: float = math.nan
    high: float = math.nan
    live: bool = False


def _diagonal(name: str, default: list[float], doc: str) -> Setting:
    return Setting(name, default, f"Variances of x, y, z, roll, pitch, yaw. {doc}")


# Formatted by hand: a table is easiest to read in rows.
# fmt: off
SETTINGS: tuple[Setting, ...] = (
    Setting("autostart", True, "Configure and activate by itself, and retry until it works."),
    Setting("cmd_vel_type", "auto",
            "Twist, TwistStamped, or auto: what the first publisher of cmd_vel publishes."),
    Setting("use_stamped_vel", False, "True is cmd_vel_type TwistStamped."),
    Setting("cmd_vel_timeout", 0.5, "A command is valid for this long from its stamp. [s]",
            0.02, 5, live=True),
    Setting("publish_rate", 50.0, "Rate of odom. [Hz]", 1, 1000),
    Setting("odom_frame_id", "odom", "Frame of the odometry."),
    Setting("base_frame_id", "base_link", "Frame of the robot."),
    Setting("tf_frame_prefix", "", "Prefix of both frames, for several robots on one graph."),
    Setting("enable_odom_tf", True, "Publish the transform odom_frame_id -> base_frame_id."),
    Setting("left_wheel_name", "left_wheel_joint", "Name in joint_states."),
    Setting("right_wheel_name", "right_wheel_joint", "Name in joint_states."),
    Setting("linear.x.max_velocity", 10.0, "Limit of the robot's velocity. [m/s]",
            0.001, 10, live=True),
    Setting("angular.z.max_velocity", 100.0, "Limit of the robot's turn rate. [rad/s]",
            0.001, 100, live=True),
    Setting("wheel_separation_multiplier", 1.0, "Real divided by nominal, from calibration.",
            0.5, 2, live=True),
    Setting("left_wheel_radius_multiplier", 1.0, "Real divided by nominal, from calibration.",
            0.5, 2, live=True),
    Setting("right_wheel_radius_multiplier", 1.0, "Real divided by nominal, from calibration.",
            0.5, 2, live=True),
    Setting("wheel_variance", 2.5e-5,
            "Variance of a wheel's travel per metre of it; the pose's covariance grows by it. "
            "[m^2/m]", 0, 1),
    _diagonal("pose_covariance_diagonal", [0.0, 0.0, 1e-6, 1e-6, 1e-6, 0.0],
              "Added to the covariance of dead reckoning."),
    _diagonal("twist_covariance_diagonal", [1e-3, 1e-6, 1e-6, 1e-6, 1e-6, 1e-2],
              "Of the measured velocity."),
)
# fmt: on

ALIASES = {
    "serial_port": "port",
    "wheel_base": "wheel_separation",
    "cpr": "counts_per_revolution",
    "max_speed": "max_velocity_mps",
    "pwm_frequency": "pwm_frequency_hz",
    "linear.x.max_acceleration": "max_acceleration_mps2",
}
"""Names from other packages, and ours. Read only at the start."""

_KIND_TYPES = {
    Kind.REAL: RosParameter.Type.DOUBLE,
    Kind.WHOLE: RosParameter.Type.INTEGER,
    Kind.SWITCH: RosParameter.Type.BOOL,
}


class ConflictingParameters(ParameterException):  # type: ignore[misc]
    """A parameter was given under two names."""

    def __init__(self, alias: str, name: str) -> None:
        super().__init__(f"{alias} is another name of {name}: give only one of them", alias)


class ParameterRefused(ParameterException):  # type: ignore[misc]
    """A parameter was given an invalid value."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(reason, name)


def declare(node: Any, own: Iterable[Setting] = ()) -> dict[str, float]:
    """Declare all parameters on a node and resolve the aliases.

    Args:
        node: An rclpy node.
        own: Settings of its class, in addition to those of every node.

    Returns:
        The robot's parameters that were given, by name, as the robot expects them.

    Raises:
        ParameterException: A value has a wrong type or is out of range.
        ConflictingParameters: Both an alias and its name were given.
    """
    settings = {s.name: s for s in (*SETTINGS, *own)}
    for setting in settings.values():
        node.declare_parameter(setting.name, _type_of(setting.default), _describe(setting))
    for parameter in ROBOT_PARAMETERS.values():
        node.declare_parameter(
            parameter.name, _KIND_TYPES[parameter.kind], describe_robot(parameter)
        )
    for alias, name in ALIASES.items():
        if node.has_parameter(name):
            _resolve_alias(node, alias, name)
    for setting in settings.values():
        if not is_set(node, setting.name):
            _set(node, RosParameter(setting.name, value=setting.default))
    _warn_of_unknown(node)
    given = [name for name in ROBOT_PARAMETERS if is_set(node, name)]
    return {name: float(node.get_parameter(name).value) for name in given}


def is_set(node: Any, name: str) -> bool:
    """Whether a parameter has a value."""
    return bool(node.get_parameter_or(name).type_ != RosParameter.Type.NOT_SET)


def from_robot(name: str, value: float) -> RosParameter:
    """Convert a robot's value to a ROS parameter."""
    kind = PARAMETER_BY_NAME[name].kind
    native = {Kind.REAL: float, Kind.WHOLE: int, Kind.SWITCH: bool}[kind](value)
    return RosParameter(name, value=native)


def describe_robot(parameter: Parameter) -> ParameterDescriptor:
    """The descriptor of one of the robot's parameters."""
    descriptor = ParameterDescriptor(
        description=f"{parameter.doc} [{parameter.unit.value or 'no unit'}]",
        additional_constraints="Stored on the robot: if not given, the robot's own value applies.",
    )
    _limit(descriptor, _KIND_TYPES[parameter.kind], parameter.minimum, parameter.maximum)
    return descriptor


def _describe(setting: Setting) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=setting.doc)
    if not setting.live:
        descriptor.additional_constraints = "Read when the node is configured."
    if not math.isnan(setting.low):
        _limit(descriptor, _type_of(setting.default), setting.low, setting.high)
    return descriptor


def _limit(descriptor: ParameterDescriptor, type_: Any, low: float, high: float) -> None:
    if type_ is RosParameter.Type.DOUBLE:
        limits = FloatingPointRange(from_value=float(low), to_value=float(high))
        descriptor.floating_point_range = [limits]
    elif type_ is RosParameter.Type.INTEGER:
        whole = IntegerRange(from_value=int(low), to_value=int(high), step=1)
        descriptor.integer_range = [whole]


def _warn_of_unknown(node: Any) -> None:
    """Warn of given parameters that nobody declared: rclpy ignores them, so a typo would go unseen.

    Not an error, because a file for `/**` may have parameters of other nodes.
    """
    # rclpy has no public access to these two.
    given = node._parameter_overrides
    known = list(node._parameters)
    unknown = [
        name + "".join(f" (did you mean {near}?)" for near in get_close_matches(name, known, n=1))
        for name in sorted(given)
        if not node.has_parameter(name)
    ]
    if unknown:
        node.get_logger().warning(f"unknown parameters, ignored: {', '.join(unknown)}")


def _resolve_alias(node: Any, alias: str, name: str) -> None:
    """Declare an alias, and give its value to the parameter that it stands for."""
    description = f"Another name of {name}, read at the start."
    node.declare_parameter(
        alias,
        RosParameter.Type(node.describe_parameter(name).type),
        ParameterDescriptor(description=description, read_only=True),
    )
    if not is_set(node, alias):
        return
    if is_set(node, name):
        raise ConflictingParameters(alias, name)
    _set(node, RosParameter(name, value=node.get_parameter(alias).value))
    node.get_logger().info(f"parameter {alias} is read as {name}")


def _set(node: Any, parameter: RosParameter) -> None:
    (result,) = node.set_parameters([parameter])
    if not result.successful:
        raise ParameterRefused(parameter.name, result.reason)


def _type_of(value: Value) -> Any:
    return RosParameter.Type.from_parameter_value(value)
