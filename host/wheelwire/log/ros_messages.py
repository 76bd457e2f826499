"""The ROS 2 messages that viewers and the node send: definitions, and their bytes in plain CDR.

REP-103 and REP-105: x forward, counter-clockwise positive; a pose in the odometry's frame, a twist
in the robot's. Components that a planar robot lacks stay 0. The code lays a message out once, by
its definition, and then fills in what changes.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

from wheelwire_protocol.codes import PeripheralKind, Place

from ..samples import InputsSample, RangeSample, SensorInfo

CDR_HEADER = b"\x00\x01\x00\x00"
"""How a message begins. Fields are aligned relative to what follows it."""


class Layout:
    """One message's fields, appended in the order of its definition.

    Each method returns the layout itself. `number` and `numbers` take codes of `struct`; without
    a value they leave a place, which `fill` fills.
    """

    def __init__(self) -> None:
        self._buffer = bytearray(CDR_HEADER)
        self._runs: list[tuple[int, str, int]] = []
        """Places that lie side by side: offset, format and number."""

    def number(self, code: str, value: float | None = None) -> Layout:
        """One number of a fixed size."""
        return self.numbers(code, 1, None if value is None else (value,))

    def numbers(self, code: str, count: int, values: tuple[float, ...] | None = None) -> Layout:
        """An array whose length is in the message's definition."""
        if count:
            one = struct.calcsize("<" + code)
            before = len(self._buffer)
            padding = -(before - len(CDR_HEADER)) % one
            self._buffer += bytes(padding + one * count)
            if values is not None:
                struct.pack_into(f"<{count}{code}", self._buffer, before + padding, *values)
            else:
                self._leave(before, padding, f"{count}{code}", count)
        return self

    def _leave(self, before: int, padding: int, format_: str, count: int) -> None:
        if self._runs:
            offset, run, places = self._runs[-1]
            if offset + struct.calcsize(run) == before:  # one call fills both
                self._runs[-1] = offset, f"{run}{padding}x{format_}", places + count
                return
        self._runs.append((before + padding, "<" + format_, count))

    def text(self, value: str) -> Layout:
        """A string."""
        data = value.encode() + b"\0"
        self.number("I", len(data))
        self._buffer += data
        return self

    def texts(self, *values: str) -> Layout:
        """A sequence of strings."""
        self.number("I", len(values))
        for value in values:
            self.text(value)
        return self

    def fill(self, *values: float) -> bytes:
        """The message with these numbers at the places left for them, in order."""
        begin = 0
        for offset, format_, count in self._runs:
            struct.pack_into(format_, self._buffer, offset, *values[begin : begin + count])
            begin += count
        return bytes(self._buffer)


class Channel(NamedTuple):
    """A topic and its messages."""

    topic: str
    schema: str
    """The name of a ROS 2 message."""
    definition: str
    """The message in ROS 2's own language, the messages that it contains included."""


NANOSECONDS = 1_000_000_000
UNKNOWN = math.nan
_FLOAT32 = 7
"""PointField's code."""
_SEPARATOR = "=" * 80 + "\nMSG: "
_CODES = dict(
    zip(["bool", "byte", "uint8", "int32", "uint32", "float32", "float64"], "BBBiIfd", strict=True)
)
"""What `struct` calls the numbers."""


def _constants(names: str, prefix: str = "", begin: int = 0) -> str:
    return "".join(f"uint8 {prefix}{name}={n}\n" for n, name in enumerate(names.split(), begin))


_DEFINITIONS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/UInt8MultiArray": "MultiArrayLayout layout\nuint8[] data\n",
    "std_msgs/MultiArrayLayout": "MultiArrayDimension[] dim\nuint32 data_offset\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation\n",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance\n",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular\n",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance\n",
    "geometry_msgs/Transform": "Vector3 translation\nQuaternion rotation\n",
    "geometry_msgs/TransformStamped": """std_msgs/Header header
string child_frame_id
Transform transform
""",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms\n",
    "nav_msgs/Odometry": """std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
""",
    "sensor_msgs/Imu": """std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
""",
    "sensor_msgs/JointState": """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
""",
    "sensor_msgs/Range": """std_msgs/Header header
uint8 ULTRASOUND=0
uint8 INFRARED=1
uint8 radiation_type
float32 field_of_view
float32 min_range
float32 max_range
float32 range
float32 variance
""",
    "sensor_msgs/PointCloud2": """std_msgs/Header header
uint32 height
uint32 width
PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
""",
    "sensor_msgs/PointField": _constants(
        "INT8 UINT8 INT16 UINT16 INT32 UINT32 FLOAT32 FLOAT64", begin=1
    )
    + "string name\nuint32 offset\nuint8 datatype\nuint32 count\n",
    "sensor_msgs/BatteryState": _constants(
        "UNKNOWN CHARGING DISCHARGING NOT_CHARGING FULL", "POWER_SUPPLY_STATUS_"
    )
    + _constants(
        "UNKNOWN GOOD OVERHEAT DEAD OVERVOLTAGE UNSPEC_FAILURE COLD WATCHDOG_TIMER_EXPIRE "
        "SAFETY_TIMER_EXPIRE",
        "POWER_SUPPLY_HEALTH_",
    )
    + _constants("UNKNOWN NIMH LION LIPO LIFE NICD LIMN TERNARY VRLA", "POWER_SUPPLY_TECHNOLOGY_")
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
""",
    "rcl_interfaces/Log": """byte DEBUG=10
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
""",
}
"""In ROS 2's own language."""


class _Field(NamedTuple):
    """One field of a message.

    Attributes:
        type: A number, "string", or the name of a message with its package.
        array: Empty; "[]", or with its length.
        name: Its name.
    """

    type: str
    array: str
    name: str


@cache
def _fields(message: str) -> tuple[_Field, ...]:
    found = []
    for line in _DEFINITIONS[message].splitlines():
        if "=" in line:  # a constant
            continue
        type_, name, *_ = line.split()  # a default comes last
        type_, bracket, length = type_.partition("[")
        if type_ not in _CODES and type_ != "string" and "/" not in type_:
            type_ = f"{message.partition('/')[0]}/{type_}"
        found.append(_Field(type_, bracket + length, name))
    return tuple(found)


def _definition(message: str) -> tuple[str, str]:
    """The message's name, and its definition with those of nested messages."""
    contained = dict.fromkeys(_contained(message))
    parts = (f"{_SEPARATOR}{name}\n{_DEFINITIONS[name]}" for name in contained)
    return message.replace("/", "/msg/"), _DEFINITIONS[message] + "".join(parts)


def _contained(message: str) -> Iterator[str]:
    for field in _fields(message):
        if field.type in _DEFINITIONS:
            yield field.type
            yield from _contained(field.type)


BYTES = _definition("std_msgs/UInt8MultiArray")
ODOMETRY = _definition("nav_msgs/Odometry")
IMU = _definition("sensor_msgs/Imu")
JOINT_STATE = _definition("sensor_msgs/JointState")
TRANSFORMS = _definition("tf2_msgs/TFMessage")
RANGE = _definition("sensor_msgs/Range")
CLOUD = _definition("sensor_msgs/PointCloud2")
BATTERY_STATE = _definition("sensor_msgs/BatteryState")
LOG = _definition("rcl_interfaces/Log")


def _laid_out(message: str, known: Mapping[str, Any], layout: Layout | None = None) -> Layout:
    """A message with what is known of its fields, by name.

    A number that is not known is a place that `fill` fills. A sequence of numbers is known by them,
    or by how many places it has.
    """
    layout = layout or Layout()
    for type_, array, name in _fields(message):
        value = known.get(name)
        if type_ in _CODES:
            _lay_out_numbers(layout, _CODES[type_], array, value)
        elif type_ == "string":
            layout.texts(*value or ()) if array else layout.text(value or "")
        elif array:
            layout.number("I", len(value or ()))
            for one in value or ():
                _laid_out(type_, one, layout)
        else:
            _laid_out(type_, value or {}, layout)
    return layout


def _lay_out_numbers(layout: Layout, code: str, array: str, value: Any) -> None:
    if not array:
        layout.number(code, value)
    elif array != "[]":
        layout.numbers(code, int(array[1:-1]), value)
    elif isinstance(value, int):
        layout.number("I", value).numbers(code, value)
    else:
        layout.number("I", len(value)).numbers(code, len(value), tuple(value))


def stamp(time_ns: int) -> tuple[int, int]:
    """The numbers that fill a header's stamp."""
    return divmod(time_ns, NANOSECONDS)


_FLAT = {"z": 0.0}
"""A position in the plane: x and y are open."""
_TURNED = {"x": 0.0, "y": 0.0}
"""A rotation in the plane: z and w are open."""


def odometry(frame: str, child_frame: str, twist_diagonal: Sequence[float] = (0.0,) * 6) -> Layout:
    """An odometry; fill in stamp, x, y, orientation's z and w, pose's covariance (36), v, w."""
    covariance = [0.0] * 36
    covariance[::7] = twist_diagonal
    twist = {"linear": {"y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0}}
    known = {
        "header": {"frame_id": frame},
        "child_frame_id": child_frame,
        "pose": {"pose": {"position": _FLAT, "orientation": _TURNED}},
        "twist": {"twist": twist, "covariance": covariance},
    }
    return _laid_out("nav_msgs/Odometry", known)


def imu(frame: str) -> Layout:
    """An IMU without orientation.

    Fill in stamp, turning (3) and its covariance (9), acceleration (3) and its covariance (9).
    """
    unknown = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    known = {
        "header": {"frame_id": frame},
        "orientation": unknown,
        "orientation_covariance": (-1.0, *(0.0,) * 8),
    }
    return _laid_out("sensor_msgs/Imu", known)


def variances(deviation: float) -> tuple[float, ...]:
    """The covariance of three axes with noise of this standard deviation each."""
    square = deviation * deviation
    return square, 0.0, 0.0, 0.0, square, 0.0, 0.0, 0.0, square


def joint_state(names: Sequence[str]) -> Layout:
    """The joints; fill in stamp, each joint's position, each joint's velocity."""
    count = len(names)
    known = {"name": names, "position": count, "velocity": count, "effort": ()}
    return _laid_out("sensor_msgs/JointState", known)


def transforms(frame: str, child_frame: str) -> Layout:
    """A `tf2_msgs/msg/TFMessage`. Fill in stamp, x, y, rotation's z and w."""
    one = {
        "header": {"frame_id": frame},
        "child_frame_id": child_frame,
        "transform": {"translation": _FLAT, "rotation": _TURNED},
    }
    return _laid_out("tf2_msgs/TFMessage", {"transforms": [one]})


def range_(frame: str, sample: RangeSample) -> Layout:
    """A distance, by ultrasound. Fill in stamp."""
    known = {
        "header": {"frame_id": frame},
        "radiation_type": 0,
        "field_of_view": sample.field_of_view_rad,
        "min_range": sample.min_m,
        "max_range": sample.max_m,
        "range": sample.distance_m,
        "variance": 0.0,
    }
    return _laid_out("sensor_msgs/Range", known)


def cloud(frame: str, points: Sequence[tuple[float, float, float]]) -> Layout:
    """A cloud of points with x, y and z. Fill in stamp."""
    data = b"".join(struct.pack("<3f", *point) for point in points)
    known = {
        "header": {"frame_id": frame},
        "height": 1,
        "width": len(points),
        "fields": [
            {"name": name, "offset": 4 * index, "datatype": _FLOAT32, "count": 1}
            for index, name in enumerate("xyz")
        ],
        "is_bigendian": 0,
        "point_step": 12,
        "row_step": len(data),
        "data": data,
        "is_dense": 1,
    }
    return _laid_out("sensor_msgs/PointCloud2", known)


def battery_state(frame: str) -> Layout:
    """A battery. Fill in stamp, voltage, current, percentage (0..1), status.

    All other fields mean unknown.
    """
    unknown = ("temperature", "charge", "capacity", "design_capacity")
    codes = ("health", "technology")
    known = {
        "header": {"frame_id": frame},
        **dict.fromkeys(unknown, UNKNOWN),
        **{f"power_supply_{code}": 0 for code in codes},
        "present": 1,
        "cell_voltage": (),
        "cell_temperature": (),
    }
    return _laid_out("sensor_msgs/BatteryState", known)


def log(time_ns: int, level: int, text: str) -> bytes:
    """One line; the level is Python's own number, which ROS has as well."""
    seconds, nanoseconds = stamp(time_ns)
    known = {
        "stamp": {"sec": seconds, "nanosec": nanoseconds},
        "level": level,
        "name": "wheelwire",
        "msg": text,
        "line": 0,
    }
    return _laid_out("rcl_interfaces/Log", known).fill()


OBSTACLES = (PeripheralKind.BUMPER, PeripheralKind.CLIFF)
ANGLES_DEG = {
    Place.NONE: 0.0,
    Place.FRONT: 0.0,
    Place.FRONT_LEFT: 45.0,
    Place.FRONT_RIGHT: -45.0,
    Place.LEFT: 90.0,
    Place.RIGHT: -90.0,
    Place.REAR: 180.0,
    Place.REAR_LEFT: 135.0,
    Place.REAR_RIGHT: -135.0,
}
"""Where an input is, counter-clockwise from the front."""


def obstacles(
    infos: Sequence[SensorInfo], sample: InputsSample, radius_m: float, height_m: float
) -> list[tuple[float, float, float]]:
    """A point where each triggered bumper or cliff is, on a circle about the robot's centre."""
    points = []
    for info in infos:
        reading = sample.channels.get(info.name)
        if info.kind in OBSTACLES and reading is not None and reading.triggered:
            angle_rad = math.radians(ANGLES_DEG[info.place])
            x_m, y_m = radius_m * math.cos(angle_rad), radius_m * math.sin(angle_rad)
            points.append((x_m, y_m, height_m))
    return points
