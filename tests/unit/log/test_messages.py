"""The messages and definitions of a recording, as the package rosbags reads them."""

from __future__ import annotations

import math
import random
import struct
from typing import Any

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from wheelwire import RangeSample
from wheelwire.log import ros_messages

STORE = get_typestore(Stores.ROS2_JAZZY)
CHANCE = random.Random(1)
DEFINITIONS = (
    ros_messages.ODOMETRY,
    ros_messages.IMU,
    ros_messages.JOINT_STATE,
    ros_messages.BATTERY_STATE,
    ros_messages.TRANSFORMS,
    ros_messages.RANGE,
    ros_messages.CLOUD,
    ros_messages.LOG,
    ros_messages.BYTES,
)


@pytest.mark.parametrize(("name", "definition"), DEFINITIONS)
def test_definitions_are_those_of_ros(name: str, definition: str) -> None:
    found = get_types_from_msg(definition, name)
    assert name in found
    for one, (constants, fields) in found.items():
        known_constants, known = STORE.fielddefs[one]
        assert fields == known, one
        assert {(key, value) for key, _, value in constants} <= {
            (key, value) for key, _, value in known_constants
        }, one


def same_again(data: bytes, name: str) -> Any:
    message = STORE.deserialize_cdr(data, name)
    # The other way round it pads with zeros, as we do; the end of an empty sequence apart.
    assert bytes(STORE.serialize_cdr(message, name))[: len(data)] == data
    return message


# Of each length that an alignment can fill.
@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "abcd", "Räder", "robot/odom"])
def test_odometry(frame: str) -> None:
    values = [CHANCE.random() for _ in range(42)]
    message = same_again(
        ros_messages.odometry(frame, "base").fill(3, 4, *values), "nav_msgs/msg/Odometry"
    )
    assert message.header.frame_id == frame
    assert message.pose.pose.position.y == values[1]
    assert message.pose.covariance.tolist() == values[4:40]
    assert message.twist.twist.angular.z == values[41]


def test_imu() -> None:
    turning, pulling = [[CHANCE.random() for _ in range(3)] for _ in range(2)]
    data = ros_messages.imu("base").fill(
        3, 4, *turning, *ros_messages.variances(0.5), *pulling, *ros_messages.variances(2.0)
    )
    message = same_again(data, "sensor_msgs/msg/Imu")
    assert message.header.frame_id == "base"
    assert message.orientation_covariance[0] == -1
    assert message.angular_velocity.z == turning[2]
    assert message.angular_velocity_covariance.tolist() == [0.25, 0, 0, 0, 0.25, 0, 0, 0, 0.25]
    assert message.linear_acceleration.x == pulling[0]
    assert message.linear_acceleration_covariance[8] == 4.0


def test_joint_state() -> None:
    layout = ros_messages.joint_state(["left", "right"])
    for _ in range(2):  # a second fill leaves nothing of the first
        values = [CHANCE.random() for _ in range(4)]
        message = same_again(layout.fill(3, 4, *values), "sensor_msgs/msg/JointState")
        assert message.name == ["left", "right"]
        assert [*message.position, *message.velocity] == values


def test_transforms() -> None:
    x, y, z, w = (CHANCE.random() for _ in range(4))
    data = ros_messages.transforms("odom", "base").fill(3, 4, x, y, z, w)
    (message,) = same_again(data, "tf2_msgs/msg/TFMessage").transforms
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base")
    assert message.transform.translation.y == y
    assert message.transform.rotation.w == w


def test_battery_state() -> None:
    data = ros_messages.battery_state("base").fill(3, 4, 7.5, -1.5, 0.25, 2)
    message = same_again(data, "sensor_msgs/msg/BatteryState")
    assert (message.voltage, message.percentage, message.present) == (7.5, 0.25, True)
    assert (message.current, message.power_supply_status) == (-1.5, 2)
    assert (message.power_supply_health, message.power_supply_technology) == (0, 0)
    for name in ("temperature", "charge", "capacity", "design_capacity"):
        assert math.isnan(getattr(message, name)), name


def test_range() -> None:
    sample = RangeSample(0, 0, "front", 1.5, 0.5, 4.0, 0.25, 0.0, 0.0)
    data = ros_messages.range_("range_front", sample).fill(3, 4)
    message = same_again(data, "sensor_msgs/msg/Range")
    assert message.header.frame_id == "range_front"
    assert (message.field_of_view, message.min_range, message.max_range) == (0.25, 0.5, 4.0)
    assert (message.range, message.radiation_type) == (1.5, 0)


@pytest.mark.parametrize("points", [[], [(1.0, 2.0, 3.0)], [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]])
def test_cloud(points: list[tuple[float, float, float]]) -> None:
    data = ros_messages.cloud("base_link", points).fill(3, 4)
    message = same_again(data, "sensor_msgs/msg/PointCloud2")
    assert (message.width, message.height, message.point_step) == (len(points), 1, 12)
    assert [field.name for field in message.fields] == ["x", "y", "z"]
    numbers = struct.unpack(f"<{3 * len(points)}f", message.data.tobytes())
    assert list(numbers) == [number for point in points for number in point]


@pytest.mark.parametrize("text", ["", "a", "ab", "abc", "abcd", "Grüße"])
def test_log(text: str) -> None:
    message = same_again(ros_messages.log(1_000_000_002, 30, text), "rcl_interfaces/msg/Log")
    assert (message.msg, message.level, message.name) == (text, 30, "wheelwire")
    assert (message.stamp.sec, message.stamp.nanosec) == (1, 2)
