"""Our CDR beside rclpy's own: the same bytes, what pads them apart, which rclpy leaves unset."""

from __future__ import annotations

import math
import random
import struct
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import BatteryState, Imu, JointState, PointCloud2, PointField, Range
from std_msgs.msg import UInt8MultiArray

import support.ros  # noqa: F401 - keeps a warning of rclpy's first use quiet
from wheelwire import RangeSample
from wheelwire.link.traffic import Kind, Record
from wheelwire.log import reader, ros_messages

MOST_PADDING = 7
"""The size that rclpy computes counts the alignment of an empty sequence at the end."""


def numbers(chance: random.Random, count: int) -> list[float]:
    return [chance.uniform(-1e6, 1e6) for _ in range(count)]


def assert_same(data: bytes, type_: Any, places: set[int]) -> Any:
    """`places`: the bytes of `data` that are no padding."""
    message = deserialize_message(data, type_)
    theirs = serialize_message(message)
    assert 0 <= len(theirs) - len(data) <= MOST_PADDING + 1
    different = [at for at, byte in enumerate(data) if byte != theirs[at] and at in places]
    assert not different
    return message


@pytest.fixture
def places(monkeypatch: pytest.MonkeyPatch) -> set[int]:
    """The bytes that were laid out since the test began, padding left out."""
    found: set[int] = set(range(len(ros_messages.CDR_HEADER)))
    laid_out = ros_messages.Layout.numbers
    text = ros_messages.Layout.text

    def numbers(
        self: ros_messages.Layout, code: str, count: int, values: Any = None
    ) -> ros_messages.Layout:
        result = laid_out(self, code, count, values)
        end = len(self._buffer)
        found.update(range(end - struct.calcsize(f"<{count}{code}"), end))
        return result

    def noted_text(self: ros_messages.Layout, value: str) -> ros_messages.Layout:
        result = text(self, value)
        end = len(self._buffer)
        found.update(range(end - len(value.encode()) - 1, end))
        return result

    monkeypatch.setattr(ros_messages.Layout, "numbers", numbers)
    monkeypatch.setattr(ros_messages.Layout, "text", noted_text)
    return found


names = pytest.mark.parametrize("name", ["", "a", "ab", "abc", "abcd", "Räder", "robot/base_link"])


@names
def test_odometry(places: set[int], name: str) -> None:
    chance = random.Random(name)
    diagonal = numbers(chance, 6)
    x, y, z, w, *covariance, linear, angular = numbers(chance, 42)
    layout = ros_messages.odometry("odom", name, diagonal)
    data = layout.fill(17, 999_999_999, x, y, z, w, *covariance, linear, angular)
    message = assert_same(data, Odometry, places)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (17, 999_999_999)
    assert (message.header.frame_id, message.child_frame_id) == ("odom", name)
    pose = message.pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == (x, y, 0)
    rotation = pose.orientation
    assert (rotation.x, rotation.y, rotation.z, rotation.w) == (0, 0, z, w)
    assert list(message.pose.covariance) == covariance
    assert list(message.twist.covariance[::7]) == diagonal
    twist = message.twist.twist
    assert (twist.linear.x, twist.linear.y, twist.linear.z) == (linear, 0, 0)
    assert (twist.angular.x, twist.angular.y, twist.angular.z) == (0, 0, angular)


@pytest.mark.parametrize("joints", [[], ["a"], ["left", "right"], ["a", "ab", "abc", "abcd"]])
def test_joint_state(places: set[int], joints: list[str]) -> None:
    values = numbers(random.Random(1), 2 * len(joints))
    data = ros_messages.joint_state(joints).fill(-1, 5, *values)
    message = assert_same(data, JointState, places)
    assert message.name == joints
    assert [*message.position, *message.velocity] == values
    assert not message.effort


@names
def test_transforms(places: set[int], name: str) -> None:
    tf2 = pytest.importorskip("tf2_msgs.msg", reason="`make ros` builds tf2_msgs")
    x, y, z, w = numbers(random.Random(name), 4)
    data = ros_messages.transforms(name, "base").fill(1, 2, x, y, z, w)
    (message,) = assert_same(data, tf2.TFMessage, places).transforms
    assert (message.header.frame_id, message.child_frame_id) == (name, "base")
    assert message.transform.translation.y == y
    assert message.transform.rotation.w == w


@names
def test_battery_state(places: set[int], name: str) -> None:
    data = ros_messages.battery_state(name).fill(1, 2, 7.5, -1.5, 0.25, 2)
    message = assert_same(data, BatteryState, places)
    assert (message.voltage, message.percentage, message.present) == (7.5, 0.25, True)
    assert message.current == -1.5
    assert message.power_supply_status == message.POWER_SUPPLY_STATUS_DISCHARGING
    assert message.power_supply_health == message.POWER_SUPPLY_HEALTH_UNKNOWN
    assert message.power_supply_technology == message.POWER_SUPPLY_TECHNOLOGY_UNKNOWN
    for field in ("temperature", "charge", "capacity", "design_capacity"):
        assert math.isnan(getattr(message, field)), field
    for field in ("cell_voltage", "cell_temperature", "location", "serial_number"):
        assert not len(getattr(message, field)), field


@names
def test_imu(places: set[int], name: str) -> None:
    turn, push = [0.1, 0.2, 0.3], [1.0, 2.0, 9.8]
    data = ros_messages.imu(name).fill(
        1, 2, *turn, *ros_messages.variances(0.5), *push, *ros_messages.variances(2.0)
    )
    message = assert_same(data, Imu, places)
    assert (message.header.stamp.sec, message.header.frame_id) == (1, name)
    velocity, acceleration = message.angular_velocity, message.linear_acceleration
    assert [velocity.x, velocity.y, velocity.z] == turn
    assert [acceleration.x, acceleration.y, acceleration.z] == push
    assert list(message.orientation_covariance) == [-1.0, *[0.0] * 8]
    assert list(message.angular_velocity_covariance) == [0.25, 0, 0, 0, 0.25, 0, 0, 0, 0.25]
    assert list(message.linear_acceleration_covariance) == [4.0, 0, 0, 0, 4.0, 0, 0, 0, 4.0]


@names
@pytest.mark.parametrize("distance_m", [0.85, math.inf, -math.inf])
def test_range(places: set[int], name: str, distance_m: float) -> None:
    sample = RangeSample(0, 0, "front", distance_m, 0.5, 4.0, 0.25, 0.0, 0.0)
    data = ros_messages.range_(name, sample).fill(1, 2)
    message = assert_same(data, Range, places)
    assert (message.header.stamp.sec, message.header.frame_id) == (1, name)
    assert message.radiation_type == Range.ULTRASOUND
    assert message.field_of_view == 0.25
    assert (message.min_range, message.max_range) == (0.5, 4.0)
    assert message.range == pytest.approx(distance_m)
    assert message.variance == 0  # unknown


@names
@pytest.mark.parametrize("points", [[], [(1.0, -2.0, 0.5), (0.25, 0.0, 0.5)]])
def test_cloud(places: set[int], name: str, points: list[tuple[float, float, float]]) -> None:
    message = assert_same(ros_messages.cloud(name, points).fill(1, 2), PointCloud2, places)
    assert (message.header.stamp.sec, message.header.frame_id) == (1, name)
    fields = [(field.name, field.offset, field.datatype) for field in message.fields]
    assert fields == [(axis, 4 * at, PointField.FLOAT32) for at, axis in enumerate("xyz")]
    assert (message.height, message.width, message.is_dense) == (1, len(points), True)
    assert len(message.data) == message.row_step == len(points) * message.point_step
    assert [*struct.iter_unpack("<3f", bytes(message.data))] == points


@names
def test_log(places: set[int], name: str) -> None:
    message = assert_same(ros_messages.log(1_500_000_000, 30, name), Log, places)
    assert (message.stamp.sec, message.stamp.nanosec) == (1, 500_000_000)
    assert (message.level, message.msg, message.line) == (Log.WARN, name, 0)


@pytest.mark.parametrize("size", [0, 1, 7, 300])
def test_a_record_of_the_tap(size: int) -> None:
    data = reader.encode_record(Record(5, Kind.SENT, 7, bytes(range(256))[:size]))
    message = assert_same(data, UInt8MultiArray, set(range(len(data))))
    assert reader.decode_record(serialize_message(message)) == reader.decode_record(data)
