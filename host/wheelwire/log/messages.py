"""The ROS 2 messages that viewers know, laid out in CDR, and their definitions.

REP-103 and REP-105: x forward, counter-clockwise positive; a pose in the odometry's frame, a twist
in the robot's. Components that a planar robot lacks stay 0.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from .cdr import Layout

NANOSECONDS = 1_000_000_000
_FLOAT32 = 7
UNKNOWN = math.nan

_SEPARATOR = "=" * 80 + "\nMSG: "
_TIME = _SEPARATOR + "builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER = _SEPARATOR + "std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + _TIME
_VECTORS = "".join(
    f"{_SEPARATOR}geometry_msgs/{name}\nfloat64 x\nfloat64 y\nfloat64 z\n"
    for name in ("Point", "Vector3")
)
_QUATERNION = (
    _SEPARATOR + "geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"
)
ODOMETRY = (
    "nav_msgs/msg/Odometry",
    """std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
"""
    + _HEADER
    + _SEPARATOR
    + "geometry_msgs/PoseWithCovariance\nPose pose\nfloat64[36] covariance\n"
    + _SEPARATOR
    + "geometry_msgs/Pose\nPoint position\nQuaternion orientation\n"
    + _QUATERNION
    + _SEPARATOR
    + "geometry_msgs/TwistWithCovariance\nTwist twist\nfloat64[36] covariance\n"
    + _SEPARATOR
    + "geometry_msgs/Twist\nVector3 linear\nVector3 angular\n"
    + _VECTORS,
)
"""The message's name, and its definition with those that it contains."""
IMU = (
    "sensor_msgs/msg/Imu",
    """std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
"""
    + _HEADER
    + _QUATERNION
    + _VECTORS,
)
JOINT_STATE = (
    "sensor_msgs/msg/JointState",
    """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
"""
    + _HEADER,
)
TRANSFORMS = (
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/TransformStamped[] transforms\n"
    + _SEPARATOR
    + "geometry_msgs/TransformStamped\n"
    + "std_msgs/Header header\nstring child_frame_id\nTransform transform\n"
    + _HEADER
    + _SEPARATOR
    + "geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n"
    + _VECTORS
    + _QUATERNION,
)
RANGE = (
    "sensor_msgs/msg/Range",
    """std_msgs/Header header
uint8 ULTRASOUND=0
uint8 INFRARED=1
uint8 radiation_type
float32 field_of_view
float32 min_range
float32 max_range
float32 range
float32 variance
"""
    + _HEADER,
)
CLOUD = (
    "sensor_msgs/msg/PointCloud2",
    """std_msgs/Header header
uint32 height
uint32 width
PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
"""
    + _HEADER
    + _SEPARATOR
    + "sensor_msgs/PointField\n"
    + "".join(
        f"uint8 {name}={number}\n"
        for number, name in enumerate(
            ("INT8", "UINT8", "INT16", "UINT16", "INT32", "UINT32", "FLOAT32", "FLOAT64"), 1
        )
    )
    + "string name\nuint32 offset\nuint8 datatype\nuint32 count\n",
)
_BATTERY_CODES = "".join(
    f"uint8 POWER_SUPPLY_{name}={number}\n"
    for names in (
        "STATUS_UNKNOWN STATUS_CHARGING STATUS_DISCHARGING STATUS_NOT_CHARGING STATUS_FULL",
        "HEALTH_UNKNOWN HEALTH_GOOD HEALTH_OVERHEAT HEALTH_DEAD HEALTH_OVERVOLTAGE "
        "HEALTH_UNSPEC_FAILURE HEALTH_COLD HEALTH_WATCHDOG_TIMER_EXPIRE "
        "HEALTH_SAFETY_TIMER_EXPIRE",
        "TECHNOLOGY_UNKNOWN TECHNOLOGY_NIMH TECHNOLOGY_LION TECHNOLOGY_LIPO TECHNOLOGY_LIFE "
        "TECHNOLOGY_NICD TECHNOLOGY_LIMN TECHNOLOGY_TERNARY TECHNOLOGY_VRLA",
    )
    for number, name in enumerate(names.split())
)
BATTERY_STATE = (
    "sensor_msgs/msg/BatteryState",
    _BATTERY_CODES
    + """std_msgs/Header header
float32 voltage
float32 temperature
float32 current
float32 charge
float32 capacity
float32 design_capacity
float32 percentage
uint8 power_supply_status
uint8 power_supply_health
uint8 power_supply_technology
bool present
float32[] cell_voltage
float32[] cell_temperature
string location
string serial_number
"""
    + _HEADER,
)
LOG = (
    "rcl_interfaces/msg/Log",
    """byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
"""
    + _TIME,
)


def _header(frame: str) -> Layout:
    """A header with a place for its stamp."""
    return Layout().number("i").number("I").text(frame)


def stamp(time_ns: int) -> tuple[int, int]:
    """The numbers that fill a header's stamp."""
    return divmod(time_ns, NANOSECONDS)


def odometry(frame: str, child_frame: str, twist_diagonal: Sequence[float] = (0.0,) * 6) -> Layout:
    """An odometry; fill in stamp, x, y, orientation's z and w, pose's covariance (36), v, w."""
    covariance = [0.0] * 36
    covariance[::7] = twist_diagonal
    return (
        _header(frame)
        .text(child_frame)
        .numbers("d", 2)
        .numbers("d", 3, (0.0, 0.0, 0.0))
        .numbers("d", 2)
        .numbers("d", 36)
        .number("d")
        .numbers("d", 4, (0.0,) * 4)
        .number("d")
        .numbers("d", 36, tuple(covariance))
    )


def imu(frame: str) -> Layout:
    """An IMU without orientation.

    Fill in stamp, turning (3) and its covariance (9), acceleration (3) and its covariance (9).
    """
    return (
        _header(frame)
        .numbers("d", 4, (0.0, 0.0, 0.0, 1.0))
        .numbers("d", 9, (-1.0, *(0.0,) * 8))  # it is unknown
        .numbers("d", 3)
        .numbers("d", 9)
        .numbers("d", 3)
        .numbers("d", 9)
    )


def variances(deviation: float) -> tuple[float, ...]:
    """The covariance of three axes with noise of this standard deviation each."""
    square = deviation * deviation
    return square, 0.0, 0.0, 0.0, square, 0.0, 0.0, 0.0, square


def joint_state(names: Sequence[str]) -> Layout:
    """The joints; fill in stamp, each joint's position, each joint's velocity."""
    count = len(names)
    layout = _header("").texts(*names)
    return layout.sequence("d", count).sequence("d", count).sequence("d", 0)


def transforms(frame: str, child_frame: str) -> Layout:
    """A `tf2_msgs/msg/TFMessage`. Fill in stamp, x, y, rotation's z and w."""
    return (
        Layout()
        .number("I", 1)
        .number("i")
        .number("I")
        .text(frame)
        .text(child_frame)
        .numbers("d", 2)
        .numbers("d", 3, (0.0, 0.0, 0.0))
        .numbers("d", 2)
    )


def range_(
    frame: str, field_of_view_rad: float, min_m: float, max_m: float, distance_m: float
) -> Layout:
    """A distance, by ultrasound. Fill in stamp."""
    return (
        _header(frame)
        .number("B", 0)
        .numbers("f", 5, (field_of_view_rad, min_m, max_m, distance_m, 0.0))
    )


def cloud(frame: str, points: Sequence[tuple[float, float, float]]) -> Layout:
    """A cloud of points with x, y and z. Fill in stamp."""
    layout = _header(frame).number("I", 1).number("I", len(points)).number("I", 3)
    for index, name in enumerate("xyz"):
        layout.text(name).number("I", 4 * index).number("B", _FLOAT32).number("I", 1)
    data = b"".join(struct.pack("<3f", *point) for point in points)
    return (
        layout.number("B", 0)
        .number("I", 12)
        .number("I", len(data))
        .number("I", len(data))
        .numbers("B", len(data), tuple(data))
        .number("B", 1)
    )


def battery_state(frame: str) -> Layout:
    """A battery of which only the voltage is measured. Fill in stamp, voltage, percentage (0..1).

    All other fields say that they are unknown.
    """
    return (
        _header(frame)
        .number("f")
        .numbers("f", 5, (UNKNOWN,) * 5)
        .number("f")
        .numbers("B", 4, (0, 0, 0, 1))  # status, health, technology unknown; it is present
        .sequence("f", 0)
        .sequence("f", 0)
        .text("")
        .text("")
    )


def log(time_ns: int, level: int, text: str) -> bytes:
    """One line; the level is Python's own number, which ROS has as well."""
    seconds, nanoseconds = stamp(time_ns)
    return (
        Layout()
        .number("i", seconds)
        .number("I", nanoseconds)
        .number("B", level)
        .text("wheelwire")
        .text(text)
        .text("")
        .text("")
        .number("I", 0)
        .fill()
    )
