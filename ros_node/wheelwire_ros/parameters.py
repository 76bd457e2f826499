"""The node's parameters: their names, aliases, types, ranges and descriptions.

There are two kinds. The node's own have a default. The robot's are the firmware's, with the
firmware's names. A robot's parameter that is not given is neither set nor listed until the robot is
open, and then shows the robot's value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from inspect import signature
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.parameter import Parameter as RosParameter

from wheelwire import Pins, driver_names
from wheelwire.robot.sensors import MAX_RATE_HZ
from wheelwire_protocol.parameters import PARAMETER_BY_NAME, Kind

from . import parameter_values as checks
from .commands import AUTO, TYPES
from .parameter_values import Get
from .robot_connection import Tuning
from .speed_limiter import AxisLimits, Limits

NO_PIN = NO_CHIP = -1
PINS = {
    name: NO_PIN if pin.default is None else int(pin.default)
    for name, pin in signature(Pins).parameters.items()
}
"""The pins of the wiring guide."""

Value = bool | int | float | str | list[float] | list[str]

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
        check: What type and range do not tell; None: they tell all.
    """

    name: str
    default: Value
    doc: str
    low: float = math.nan
    high: float = math.nan
    live: bool = False
    check: checks.Check | None = None

    @property
    def type_(self) -> Any:
        """The type that the parameter is declared with."""
        return RosParameter.Type.from_parameter_value(self.default)


def _diagonal(name: str, default: list[float], doc: str) -> Setting:
    doc = f"Variances of x, y, z, roll, pitch, yaw. {doc}"
    return Setting(name, default, doc, check=checks.variances)


def _limits(axis: str, unit: str) -> tuple[Setting, ...]:
    """diff_drive_controller's limits of one component, with its signs."""

    def limit(name: str, check: checks.Check, doc: str, derivative: str = "") -> Setting:
        doc += f" .NAN: no limit. [{unit}{derivative}]"
        return Setting(f"{axis}.{name}", math.nan, doc, live=True, check=check)

    # Checks instead of ranges: rclpy refuses NaN for a parameter that has a range.
    high, low = checks.at_least_zero, checks.at_most_zero
    # With 0 the robot would never move, and nothing would say why.
    above = checks.above_zero
    return (
        limit("max_velocity", above, "Limit of the robot's velocity."),
        limit("min_velocity", low, "The same of negative ones; .NAN: -max_velocity."),
        limit("max_acceleration", above, "Limit of speeding up.", "/s"),
        limit("max_deceleration", low, "Limit of slowing down; .NAN: -max_acceleration.", "/s"),
        limit("max_acceleration_reverse", low, "Backwards; .NAN: -max_acceleration.", "/s"),
        limit("max_deceleration_reverse", high, "Backwards; .NAN: -max_deceleration.", "/s"),
        limit("max_jerk", above, "Limit of how fast the acceleration may grow.", "/s^2"),
        limit("min_jerk", low, "The same downwards; .NAN: -max_jerk.", "/s^2"),
    )


def _pin(name: str, default: int) -> Setting:
    doc = "l298n, pigpio: GPIO, BCM number."
    if default == NO_PIN:
        doc += f" {NO_PIN}: not fitted."
    return Setting(f"pins.{name}", default, doc, min(default, 0), 27)


def _foreign(name: str, accepted: Value, instead: str) -> Setting:
    doc = f"Of diff_drive_controller. Only {_shown(accepted)}: {instead}."
    return Setting(name, accepted, doc, check=checks.only(accepted, instead))


def _shown(value: Value) -> str:
    if isinstance(value, float) and math.isnan(value):
        return ".NAN"
    return str(value).lower() if isinstance(value, bool) else str(value)


# Formatted by hand: a table is easiest to read in rows.
# fmt: off
SETTINGS: tuple[Setting, ...] = (
    Setting("autostart", True, "Configure and activate by itself, and retry until it works."),
    Setting("cmd_vel_type", "auto",
            "Twist, TwistStamped, or auto: of whichever type the first message is.",
            check=checks.one_of(*TYPES, AUTO)),
    Setting("use_stamped_vel", False, "True is cmd_vel_type TwistStamped."),
    Setting("cmd_vel_timeout", 0.5, "A command is valid for this long from its stamp. [s]",
            0.02, 5, live=True, check=checks.command_timeout),
    Setting("publish_rate", 50.0, "Rate of odom. [Hz]", 1, 1000),
    Setting("odom_frame_id", "odom", "Frame of the odometry.", check=checks.frame),
    Setting("base_frame_id", "base_link", "Frame of the robot.", check=checks.frame),
    Setting("tf_frame_prefix", "", "Prefix of both frames, for several robots on one graph."),
    Setting("tf_frame_prefix_enable", True, "False: the frames have no prefix."),
    Setting("battery_empty_v", math.nan,
            "Voltage of the empty battery, 0 % in battery_state. .NAN: by the board's cells. [V]",
            check=checks.above_zero),
    Setting("battery_full_v", math.nan,
            "Voltage of the full battery, 100 % in battery_state. .NAN: by the board's cells. [V]",
            check=checks.above_zero),
    Setting("imu_rate", 100, "Rate of imu/data_raw at most, where the board has an IMU. [Hz]",
            1, MAX_RATE_HZ),
    Setting("imu_frame_id", "imu_link", "Frame of the IMU: at its place, with the robot's axes.",
            check=checks.frame),
    Setting("imu_bias_at_rest", True,
            "Measure the gyroscope's bias whenever the wheels stand for a second; subtract it."),
    Setting("bumper_radius", 0.2,
            "Bumpers and cliffs are published as points at this distance from the robot's centre, "
            "outside the body that Nav2 knows. [m]", 0, 10),
    Setting("bumper_height", 0.05, "Height of these points. [m]", 0, 10),
    Setting("pose_file", "auto",
            "Where the pose is saved for the next start. auto: below ROS_HOME, by the name of the "
            "node and its board. Empty: nowhere, and each start begins at the origin."),
    Setting("enable_odom_tf", True, "Publish the transform odom_frame_id -> base_frame_id."),
    Setting("left_wheel_names", ["left_wheel_joint"],
            "Names in joint_states; several wheels of a side turn together.",
            check=checks.wheel_names),
    Setting("right_wheel_names", ["right_wheel_joint"], "The same for the other side.",
            check=checks.wheel_names),
    Setting("wheels_per_side", 0, "0: as many as there are names.", 0, 100),
    Setting("max_rpm", math.nan, "Limit of each wheel's speed. .NAN: none. [1/min]",
            live=True, check=checks.above_zero),
    *_limits("linear.x", "m/s"),
    *_limits("angular.z", "rad/s"),
    Setting("velocity_rolling_window_size", 1,
            "The twist in odom is the mean of this many samples, at publish_rate. 1: as the robot "
            "measures it, over velocity_window_us.", 1, 1000),
    Setting("publish_limited_velocity", False, "Publish the limited command on ~/cmd_vel_out."),
    *(Setting(f"{name}_multiplier", 1.0, "Real divided by nominal, from calibration.",
              0.5, 2, live=True)
      for name in ("wheel_separation", "left_wheel_radius", "right_wheel_radius")),
    Setting("wheel_variance", 2.5e-5,
            "Variance of a wheel's travel per metre of it; the pose's covariance grows by it. "
            "[m^2/m]", 0, 1),
    _diagonal("pose_covariance_diagonal", [0.0, 0.0, 1e-6, 1e-6, 1e-6, 0.0],
              "Added to the covariance of dead reckoning."),
    _diagonal("twist_covariance_diagonal", [1e-3, 1e-6, 1e-6, 1e-6, 1e-6, 1e-2],
              "Of the measured velocity."),
    _foreign("open_loop", False,
             "odometry is what the encoders counted; the robot does not drive without them"),
    _foreign("position_feedback", True,
             "the robot counts ticks; integrated velocities would be less exact"),
    *(_foreign(f"{axis}.has_{kind}_limits", True, f"write .NAN for the limits of {kind} instead")
      for axis in ("linear.x", "angular.z") for kind in ("velocity", "acceleration", "jerk")),
    *(_foreign(f"{axis}.min_acceleration", math.nan, f"write {axis}.max_deceleration instead")
      for axis in ("linear.x", "angular.z")),
    Setting("driver_type", "serial",
            f"The driver: {', '.join(driver_names())}."),
    Setting("port", "/dev/wheelwire", "serial: device path, or socket://host:port."),
    Setting("baud_rate", 921_600, "serial: the rate to try first; then the usual ones. [baud]",
            1200, 4_000_000),
    Setting("board_id", "", "serial: accept only this board, 12 hex digits; port may then be glob "
            "patterns, separated by commas."),
    Setting("any_board", False, "serial: continue with another board if one appears at the port."),
    Setting("board", "", "serial: drive only if the device is on this board: a built-in board's "
            "name, or a file. Empty: whichever was confirmed. l298n, pigpio: the pins and the "
            "sensors, in place of pins.*."),
    Setting("pwm_chip", NO_CHIP, f"l298n: N of /sys/class/pwm/pwmchipN. {NO_CHIP}: find it.",
            NO_CHIP, 99),
    Setting("pigpio_host", "localhost", "pigpio: the daemon's computer."),
    Setting("pigpio_port", 8888, "pigpio: the daemon's TCP port.", 1, 65_535),
    Setting("tap", True, "serial, l298n, pigpio: other programs on this computer may look, stop "
            "and e-stop beside the node."),
    Setting("replay_file", "", "replay: the recording."),
    Setting("replay_speed", 1.0, "replay: how much faster than recorded; 0: as fast as the node "
            "takes it, sample by sample.", 0.0, 1000.0),
    Setting("record", "", "Record the link to this file, or to a file in this folder. Empty: no "
            "recording."),
    *(_pin(name, default) for name, default in PINS.items()),
)
# fmt: on

_NATIVE: dict[Kind, Any] = {Kind.REAL: float, Kind.WHOLE: int, Kind.SWITCH: bool}


def declare(node: Any) -> None:
    """Declare the parameters: the node's own with their defaults, the robot's without a value.

    This ignores what the user gave: see `start_values`.
    """
    for setting in SETTINGS:
        descriptor = _describe(setting.doc, setting.type_, setting.low, setting.high)
        if not setting.live:
            descriptor.additional_constraints = "Read when the node is configured."
        node.declare_parameter(setting.name, setting.default, descriptor, ignore_override=True)
    for parameter in ROBOT_PARAMETERS.values():
        doc = f"{parameter.doc} [{parameter.unit.value or 'no unit'}]"
        type_ = RosParameter.Type.from_parameter_value(_NATIVE[parameter.kind]())
        descriptor = _describe(doc, type_, parameter.minimum, parameter.maximum)
        descriptor.additional_constraints = (
            "Stored on the robot: if not given, the robot's own value applies."
        )
        # With a type instead of a default: the value is unknown until the robot is open.
        node.declare_parameter(parameter.name, type_, descriptor, ignore_override=True)


def is_set(node: Any, name: str) -> bool:
    """Whether a parameter has a value."""
    return bool(node.get_parameter_or(name).type_ != RosParameter.Type.NOT_SET)


def from_robot(name: str, value: float) -> RosParameter:
    """Convert a robot's value to a ROS parameter."""
    # On the wire each value is a float, and ROS refuses one for an integer or a switch.
    return RosParameter(name, value=_NATIVE[PARAMETER_BY_NAME[name].kind](value))


def _describe(doc: str, type_: Any, low: float, high: float) -> ParameterDescriptor:
    """A descriptor; without a range if that is NaN, or if the type is not a number."""
    descriptor = ParameterDescriptor(description=doc)
    if not math.isnan(low) and type_ is RosParameter.Type.DOUBLE:
        limits = FloatingPointRange(from_value=float(low), to_value=float(high))
        descriptor.floating_point_range = [limits]
    elif not math.isnan(low) and type_ is RosParameter.Type.INTEGER:
        whole = IntegerRange(from_value=int(low), to_value=int(high), step=1)
        descriptor.integer_range = [whole]
    return descriptor


GAPS = "rearm_gap_s", "ttl_max_s"
"""Parameters of the robot; the longer of the two is the pause that ends a hold."""


def tuning(get: Get) -> Tuning:
    """The settings that can change while the robot is open."""
    max_rpm = get("max_rpm")
    return Tuning(
        timeout_s=get("cmd_vel_timeout"),
        limits=Limits(_axis_limits("linear.x", get), _axis_limits("angular.z", get)),
        max_wheel_radps=math.inf if math.isnan(max_rpm) else max_rpm * 2 * math.pi / 60,
        separation_multiplier=get("wheel_separation_multiplier"),
        left_radius_multiplier=get("left_wheel_radius_multiplier"),
        right_radius_multiplier=get("right_wheel_radius_multiplier"),
        rearm_gap_s=max(get(name) or 0.0 for name in GAPS),  # None before the robot is open
    )


def _axis_limits(axis: str, get: Get) -> AxisLimits:
    return AxisLimits(**{field.name: get(f"{axis}.{field.name}") for field in fields(AxisLimits)})
