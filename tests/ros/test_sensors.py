"""Topics of sensors and battery, and words about them: what the board measures, nothing stale."""

from __future__ import annotations

import itertools
import math
import struct
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import Imu, PointCloud2, Range

from support.range_board import ABOUT_M, simulator_on_board
from support.ros import Diagnostics, Graph, wait
from support.ros_process import RobotNode
from support.ros_rig import Rig, State, open_rig, silent, stamp_s, values
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.peripherals import IMUS, SensorChip

TABLE = IMUS[SensorChip.MPU6050]
GRAVITY_MPS2 = 9.8
RADIUS_M = 0.2
HEIGHT_M = 0.05
OBEYED_S = 0.5
OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


def points(cloud: Any) -> list[tuple[float, float, float]]:
    """Those of a cloud, read by its own description."""
    offsets = {field.name: field.offset for field in cloud.fields}
    assert [offsets[name] for name in "xyz"] == [0, 4, 8]
    assert len(cloud.data) == cloud.row_step == cloud.width * cloud.point_step
    found = struct.iter_unpack("<3f", bytes(cloud.data))
    return [(x, y, z) for x, y, z in found]


def test_the_node_names_frame_radius_and_rate(graph: Graph, tmp_path: Path) -> None:
    with (
        Simulator(link=tmp_path / "port") as simulator,
        RobotNode(
            graph,
            port=simulator.port,
            tf_frame_prefix="robot1",
            imu_frame_id="gyro",
            imu_rate=50,
            bumper_radius=0.5,
            bumper_height=0.0,
        ),
    ):
        simulator.set("bumper.front_left", 1)
        imu = graph.listen(Imu, "imu/data_raw")
        clouds = graph.listen(PointCloud2, "bumpers")
        wait(lambda: len(imu) > 20 and clouds and points(clouds[-1]), "both topics")
    assert imu[-1].header.frame_id == "robot1/gyro"
    assert clouds[-1].header.frame_id == "robot1/base_link"
    ((x_m, y_m, z_m),) = points(clouds[-1])
    assert (math.hypot(x_m, y_m), z_m) == pytest.approx((0.5, 0.0))
    seconds = stamp_s(imu[-1]) - stamp_s(imu[-11])
    assert seconds == pytest.approx(10 / 50, abs=0.05)


def test_a_range_is_in_its_frame_and_comes_once_and_a_voltage_is_diagnosed(
    graph: Graph, tmp_path: Path
) -> None:
    front, left = graph.listen(Range, "range/front"), graph.listen(Range, "range/left")
    with (
        simulator_on_board(link=tmp_path / "port") as simulator,
        RobotNode(graph, port=simulator.port, tf_frame_prefix="robot1"),
    ):
        simulator.set("range.left_m", 2.5)
        simulator.set("analog.2_v", 3.0)
        wait(lambda: left and abs(left[-1].range - 2.5) < ABOUT_M, "range/left")
        wait(lambda: len(front) > 10, "range/front")
        told = Diagnostics(graph).wait(
            "sensor analog_2",
            lambda _, v: "voltage_v" in v and abs(float(v["voltage_v"]) - 3) < 0.05,
        )
        late_s = graph.now_s() - stamp_s(front[-1])
    assert told["kind"] == "ANALOG"
    message = front[-1]
    assert message.range == pytest.approx(1.0, abs=ABOUT_M)
    assert message.header.frame_id == "robot1/range_front"
    assert left[-1].header.frame_id == "robot1/range_left"
    assert message.radiation_type == Range.ULTRASOUND
    assert (message.min_range, message.max_range) == pytest.approx((0.02, 4.0))
    assert message.field_of_view == pytest.approx(0.26)
    stamps = [stamp_s(one) for one in tuple(front)[-10:]]
    assert all(later > earlier for earlier, later in itertools.pairwise(stamps))
    assert 0 <= late_s < 1


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with open_rig(tmp_path_factory.mktemp("rig")) as rig:
        yield rig


@pytest.fixture(scope="module")
def imu(rig: Rig) -> deque[Any]:
    return rig.graph.listen(Imu, "imu/data_raw")


@pytest.fixture(scope="module")
def clouds(rig: Rig) -> deque[Any]:
    return rig.graph.listen(PointCloud2, "bumpers")


@pytest.fixture(scope="module")
def state(rig: Rig) -> State:
    return State(rig.graph)


def test_an_imu_at_rest(rig: Rig, imu: deque[Any]) -> None:
    wait(lambda: len(imu) > 100, "imu/data_raw")
    message = imu[-1]
    assert message.header.frame_id == "imu_link"
    assert message.orientation_covariance[0] == -1
    assert not any(message.orientation_covariance[1:])
    assert message.linear_acceleration.z == pytest.approx(GRAVITY_MPS2, abs=0.2)
    assert message.angular_velocity.z == pytest.approx(0, abs=0.02)
    for matrix, noise in (
        (message.angular_velocity_covariance, TABLE.gyro_noise * TABLE.gyro_radps),
        (
            message.linear_acceleration_covariance,
            TABLE.accelerometer_noise * TABLE.accelerometer_mps2,
        ),
    ):
        expected = [0.0] * 9
        expected[::4] = [noise**2] * 3
        assert list(matrix) == pytest.approx(expected, rel=1e-4)
    stamps = [stamp_s(one) for one in tuple(imu)[-100:]]
    steps = [later - earlier for earlier, later in itertools.pairwise(stamps)]
    assert min(steps) > 0
    assert sorted(steps)[len(steps) // 2] == pytest.approx(0.01, abs=0.001)
    assert 0 <= rig.graph.now_s() - stamps[-1] < 1


def test_the_gyroscopes_bias_is_taken_off_at_rest(rig: Rig, imu: deque[Any]) -> None:
    rig.truth(lambda state: not state.drive_on)
    rig.simulator.set("imu.bias", 0.05)
    wait(lambda: imu and imu[-1].angular_velocity.z > 0.04, "the bias")
    wait(lambda: abs(imu[-1].angular_velocity.z) < 0.005, "the same taken off")
    rig.simulator.set("imu.bias", 0.0)
    wait(lambda: abs(imu[-1].angular_velocity.z) > 0.04, "the change")
    wait(lambda: abs(imu[-1].angular_velocity.z) < 0.005, "no bias")


def test_a_stale_imu_is_silent_and_says_why(rig: Rig, imu: deque[Any], state: State) -> None:
    state.wait(lambda v: v["link"] == "connected" and not v["sensors"])
    rig.diagnostics.wait("sensor imu", lambda s, _: s.level == OK)
    rig.simulator.set("imu.absent", 1)
    told = rig.diagnostics.wait("sensor imu", lambda _, v: v["reason"] == "ABSENT")
    assert told["state"] == "STALE"
    told = state.wait(lambda v: "imu: STALE, ABSENT" in v["sensors"])
    assert told.level == WARN
    assert "it does not answer" in told.message
    assert not values(told)["cause"]
    with silent(rig.graph, imu, beside=rig.odometry):
        rig.simulator.set("imu.absent", 0)
    rig.diagnostics.wait("sensor imu", lambda s, _: s.level == OK)
    assert state.wait(lambda v: not v["sensors"]).level == OK


def test_a_bumper_is_a_point_where_it_is_and_the_robot_only_backs_out(
    rig: Rig, clouds: deque[Any], state: State
) -> None:
    across_m = RADIUS_M * math.sqrt(0.5)
    wait(lambda: clouds and not points(clouds[-1]), "an empty cloud")
    rig.simulator.set("bumper.front_left", 1)
    wait(lambda: points(clouds[-1]), "a point")
    cloud = clouds[-1]
    assert cloud.header.frame_id == "base_link"
    assert points(cloud) == [pytest.approx((across_m, across_m, HEIGHT_M))]
    told = state.wait(lambda v: v["triggered"] == "bumper.front_left")
    assert values(told)["reflexes"] == "NO_FORWARD"
    assert told.message == "bumper.front_left triggered: the robot only backs out"
    assert told.level == WARN
    rig.diagnostics.wait("sensor bumper.front_left", lambda s, _: s.level == WARN)

    rig.simulator.set("bumper.front_right", 1)
    wait(lambda: len(points(clouds[-1])) == 2, "two points")
    assert sorted(y_m for _, y_m, _ in points(clouds[-1])) == pytest.approx([-across_m, across_m])
    with rig.driving():
        time.sleep(OBEYED_S)
        rig.truth(lambda state: not state.drive_on)
    with rig.driving(-0.2):
        rig.truth(lambda state: state.drive_on)

    rig.simulator.set("bumper.front_left", 0)
    rig.simulator.set("bumper.front_right", 0)
    wait(lambda: not points(clouds[-1]), "an empty cloud again")
    # The device says what holds it up to 0.1 s later.
    told = state.wait(lambda v: not v["triggered"] and not v["held_by"])
    assert not values(told)["reflexes"]
    assert told.level == OK
