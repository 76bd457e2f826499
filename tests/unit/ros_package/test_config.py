"""The parameter files: of the node, Nav2, the filter, and diagnostic_aggregator."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import pytest
import yaml

from support.aggregator import ERROR, OK, STALE, WARN, Aggregator
from support.cases import each
from support.nav2 import Command, Smoother, shipped
from wheelwire import Pins, load_config
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.peripherals import IMUS, SensorChip

PACKAGE = Path(__file__).parents[3] / "ros_node"
CONFIG = PACKAGE / "config"

Parameters = dict[str, Any]


@pytest.fixture(scope="module")
def node() -> Parameters:
    """The defaults of the robot's node."""
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros.parameters import SETTINGS

    return {setting.name: setting.default for setting in SETTINGS}


@pytest.fixture(scope="module")
def model() -> ET.Element:
    return ET.parse(PACKAGE / "urdf" / "pi4b.urdf").getroot()  # noqa: S314 - our own file


@pytest.mark.parametrize("file", sorted(CONFIG.glob("*.yaml")), ids=lambda file: file.name)
def test_ros_reads_it(file: Path) -> None:
    """Its parser is stricter than YAML: no aliases, no lists of mixed types."""
    rclpy = pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    context = rclpy.Context()
    rclpy.init(args=["--ros-args", "--params-file", str(file)], context=context)
    rclpy.shutdown(context=context)


# --- pi4b_params.yaml ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def parameters() -> Parameters:
    content = yaml.safe_load((CONFIG / "pi4b_params.yaml").read_text())
    assert list(content) == ["/**"]
    assert list(content["/**"]) == ["ros__parameters"]
    return dict(content["/**"]["ros__parameters"])


def test_the_robot_is_the_librarys(parameters: Parameters) -> None:
    robots = {name: value for name, value in parameters.items() if name in PARAMETER_BY_NAME}
    assert robots == load_config().parameters


def test_each_is_declared_with_this_type(parameters: Parameters, node: Parameters) -> None:
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros.parameters import ROBOT_PARAMETERS, from_robot

    for name, value in parameters.items():
        if name in ROBOT_PARAMETERS:
            assert from_robot(name, value).value == value
            assert type(value) is type(from_robot(name, value).value), name
        else:
            assert type(value) is type(node[name]), name


def test_the_pins_are_the_librarys() -> None:
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros.parameters import PINS

    assert Pins(**{n: p for n, p in PINS.items() if p >= 0}) == load_config().pins


# --- nav2_params.yaml ---------------------------------------------------------------------------

MAP = "map"
SENDERS = {
    "controller_server",
    "behavior_server",
    "velocity_smoother",
    "collision_monitor",
    "docking_server",
}
"""Nodes that publish cmd_vel or a topic on the way to it."""
X, YAW = 0, 2


@pytest.fixture(scope="module")
def nav2() -> Parameters:
    """The parameters by node."""
    content = yaml.safe_load((CONFIG / "nav2_params.yaml").read_text())
    for costmap in ("local_costmap", "global_costmap"):
        content[costmap] = content[costmap][costmap]
    return {node: entry["ros__parameters"] for node, entry in content.items()}


def test_whole_numbers_are_where_nav2_expects_them(nav2: Parameters) -> None:
    """A parameter of the other type ends a server."""
    whole = {name for name, value in _entries(nav2) if type(value) is int}
    assert whole == {"width", "height", "min_points"}


def test_nav2s_frames_are_the_nodes(nav2: Parameters, node: Parameters, model: ET.Element) -> None:
    base, odom = node["base_frame_id"], node["odom_frame_id"]
    assert model.find(f"link[@name='{base}']") is not None
    of_the_base = {"base_frame_id", "robot_base_frame", "base_frame"}
    of_odometry = {"odom_frame_id", "local_frame", "fixed_frame"}
    for name, value in _entries(nav2):
        if name in of_the_base:
            assert value == base, name
        elif name in of_odometry:
            assert value == odom, name
    fixed = {n: p["global_frame"] for n, p in nav2.items() if "global_frame" in p}
    assert fixed.pop("local_costmap") == odom
    assert set(fixed.values()) == {MAP}


def test_topics_are_the_nodes(nav2: Parameters) -> None:
    pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")
    from wheelwire_ros.commands import TOPIC

    assert nav2["collision_monitor"]["cmd_vel_out_topic"] == TOPIC
    assert {value for name, value in _entries(nav2) if name == "odom_topic"} == {"odom"}
    scans = [p["topic"] for name, p in _entries(nav2) if name == "scan"]
    assert len(scans) == 3
    assert {topic.removeprefix("/") for topic in scans} == {"scan"}
    for costmap in ("local_costmap", "global_costmap"):  # they have namespaces of their own
        layer = nav2[costmap]["obstacle_layer"]
        assert layer["observation_sources"].split() == ["scan", "bumpers"]
        assert layer["scan"]["topic"] == "/scan"
        assert layer["bumpers"]["topic"] == "/bumpers"
        assert layer["bumpers"]["data_type"] == "PointCloud2"


def test_the_bumpers_points_are_outside_what_nav2_clears(
    nav2: Parameters, node: Parameters
) -> None:
    radius = node["bumper_radius"]
    for costmap in ("local_costmap", "global_costmap"):
        assert nav2[costmap]["robot_radius"] < radius < 2 * nav2[costmap]["robot_radius"]


def test_all_senders_have_the_same_type(nav2: Parameters) -> None:
    types = {name: p.get("enable_stamped_cmd_vel") for name, p in nav2.items()}
    assert {name for name, stamped in types.items() if stamped is not None} == SENDERS
    assert {types[name] for name in SENDERS} == {True}


def test_velocities_are_the_robots(nav2: Parameters) -> None:
    robot = load_config().parameters
    smoother, follow = nav2["velocity_smoother"], nav2["controller_server"]["FollowPath"]
    linear_mps, angular_radps = (smoother["max_velocity"][axis] for axis in (X, YAW))
    outer_wheel_mps = linear_mps + angular_radps * robot["wheel_separation"] / 2
    assert outer_wheel_mps <= robot["max_velocity_mps"] + 1e-9
    assert smoother["min_velocity"] == [-limit for limit in smoother["max_velocity"]]
    assert follow["desired_linear_vel"] <= linear_mps
    assert follow["rotate_to_heading_angular_vel"] <= angular_radps
    assert nav2["behavior_server"]["max_rotational_vel"] <= angular_radps
    docking = nav2["docking_server"]["controller"]  # it is not smoothed
    assert docking["v_linear_max"] <= linear_mps
    assert docking["v_angular_max"] <= angular_radps


def test_accelerations_are_the_robots(nav2: Parameters) -> None:
    limit = PARAMETER_BY_NAME["max_acceleration_mps2"].default
    smoother = nav2["velocity_smoother"]
    assert smoother["max_accel"][X] < limit
    assert smoother["max_decel"] == [-limit for limit in smoother["max_accel"]]
    follow = nav2["controller_server"]["FollowPath"]
    assert follow["max_angular_accel"] <= smoother["max_accel"][YAW]


def test_a_command_lives_as_long_everywhere(nav2: Parameters, node: Parameters) -> None:
    smoother = nav2["velocity_smoother"]
    assert smoother["velocity_timeout"] < node["cmd_vel_timeout"] / 2
    assert 1 / smoother["smoothing_frequency"] < node["cmd_vel_timeout"] / 2


@pytest.mark.parametrize("late", [0.0, 0.2, 0.4, 0.6, 0.8])
def test_a_dead_controller_is_obeyed_for_as_long_as_the_page_says(late: float) -> None:
    """Its last command came so far into a period of the smoother."""
    smoother = Smoother(shipped("velocity_smoother"))
    period_s = smoother.period_s
    died_s = 100.0
    published = []
    step_s = died_s - 2.0 + period_s * (1 - late)
    commands = [died_s - 0.05 * count for count in range(40, -1, -1)]
    while step_s < died_s + 2.0:
        while commands and commands[0] <= step_s:
            smoother.command(Command(0.3, 0.0, commands.pop(0)))
        command = smoother.step(step_s)
        if command is not None:
            published.append(command)
        step_s += period_s
    fast = [command for command in published if command.linear_mps > 0.299]
    moving = [command for command in published if not command.is_zero]
    assert fast[-1].stamp_s - died_s <= 0.2
    assert moving[-1].stamp_s - died_s <= 0.55
    assert published[-1].is_zero  # it ends with a zero: the robot need not wait for its time-out


def test_the_radius_covers_the_body(nav2: Parameters, model: ET.Element) -> None:
    (box,) = model.findall(".//collision/geometry/box")
    length_m, width_m, _ = map(float, box.attrib["size"].split())
    origin = model.find("joint[@name='chassis_joint']/origin")
    assert origin is not None
    forward_m = float(origin.attrib["xyz"].split()[0])
    farthest_m = math.hypot(abs(forward_m) + length_m / 2, width_m / 2)
    for costmap in ("local_costmap", "global_costmap"):
        radius_m = nav2[costmap]["robot_radius"]
        assert farthest_m <= radius_m <= farthest_m + 0.01
        assert nav2[costmap]["inflation_layer"]["inflation_radius"] > radius_m


def test_every_plugin_that_is_named_is_there(nav2: Parameters) -> None:
    for name, parameters in nav2.items():
        for key, listed in parameters.items():
            if key.endswith("plugins"):
                for plugin in listed:
                    assert "::" in parameters[plugin]["plugin"], f"{name}: {plugin}"


def test_the_robots_node_keeps_no_bond(nav2: Parameters) -> None:
    manager = nav2["lifecycle_manager_robot"]
    assert manager["node_names"] == ["hardware_robot"]
    assert manager["bond_timeout"] == 0.0


def _entries(parameters: Parameters) -> Iterator[tuple[str, Any]]:
    """All names with their values, those within others too."""
    for name, value in parameters.items():
        yield name, value
        if isinstance(value, dict):
            yield from _entries(value)


# --- ekf.yaml -----------------------------------------------------------------------------------

STATES = 15
VX, VY, VYAW = 6, 7, 11
"""Indices among position, attitude, their rates and the accelerations."""
IN_TWIST = {VX: 0, VY: 1, VYAW: 5}
"""Their places in twist_covariance_diagonal."""


@pytest.fixture(scope="module")
def ekf() -> Parameters:
    content = yaml.safe_load((CONFIG / "ekf.yaml").read_text())
    assert list(content) == ["ekf_filter_node"]
    parameters: Parameters = content["ekf_filter_node"]["ros__parameters"]
    return parameters


def test_the_filters_frames_are_the_nodes(
    ekf: Parameters, node: Parameters, model: ET.Element
) -> None:
    assert ekf["odom_frame"] == ekf["world_frame"] == node["odom_frame_id"]
    assert ekf["base_link_frame"] == node["base_frame_id"]
    assert model.find(f"link[@name='{ekf['base_link_frame']}']") is not None


def test_the_wheels_give_velocities_with_a_variance(ekf: Parameters, node: Parameters) -> None:
    assert ekf["odom0"] == "odom"
    fused = _fused(ekf["odom0_config"])
    assert fused == {VX, VY, VYAW}
    variances = node["twist_covariance_diagonal"]
    assert all(float(variances[IN_TWIST[state]]) > 0 for state in fused)


def test_the_imu_gives_the_yaw_rate(ekf: Parameters) -> None:
    assert ekf["imu0"] == "imu/data_raw"
    assert _fused(ekf["imu0_config"]) == {VYAW}


def test_the_wheels_turn_counts_only_without_the_imu(node: Parameters) -> None:
    variances = node["twist_covariance_diagonal"]
    table = IMUS[SensorChip.MPU6050]
    gyro = (table.gyro_noise * table.gyro_radps) ** 2
    assert float(variances[IN_TWIST[VYAW]]) / gyro == pytest.approx(30_000, rel=0.1)


def test_one_of_them_publishes_the_transform(ekf: Parameters, node: Parameters) -> None:
    assert ekf["publish_tf"] is True
    text = (CONFIG / "ekf.yaml").read_text()
    assert "enable_odom_tf: false" in text
    assert "enable_odom_tf" in node


def test_the_filter_is_as_fast_as_odometry(ekf: Parameters, node: Parameters) -> None:
    assert ekf["frequency"] == node["publish_rate"]
    assert ekf["two_d_mode"] is True


def _fused(config: list[bool]) -> set[int]:
    assert len(config) == STATES
    return {index for index, fused in enumerate(config) if fused}


# --- diagnostics_aggregator.yaml ----------------------------------------------------------------

ALWAYS = ("link", "robot", "commands")
PLACES = {
    **dict.fromkeys(ALWAYS, "Drive"),
    **dict.fromkeys(("clock", "name"), "Node"),
    **dict.fromkeys(("sensor front", "sensor imu"), "Sensors"),
}


@pytest.fixture
def aggregator() -> Aggregator:
    return load_aggregator()


def load_aggregator() -> Aggregator:
    content = yaml.safe_load((CONFIG / "diagnostics_aggregator.yaml").read_text())
    assert list(content) == ["analyzers"], "the name of the aggregator's node"
    assert list(content["analyzers"]) == ["ros__parameters"]
    return Aggregator(content["analyzers"]["ros__parameters"])


def report(aggregator: Aggregator, now_s: float, **levels: int) -> int:
    """What the node reports once a second, and a few seconds later the robot's level."""
    for subject in ALWAYS:
        aggregator.take(f"hardware_robot: {subject}", levels.pop(subject, OK), now_s)
    for subject, level in levels.items():
        aggregator.take(f"hardware_robot: {subject.replace('_', ' ')}", level, now_s)
    return aggregator.level(now_s + 1)


@each(("subject", "place"), list(PLACES.items()))
def test_each_status_has_one_place(subject: str, place: str) -> None:
    assert load_aggregator().takers(f"hardware_robot: {subject}") == [place]


def test_a_sound_robot_is_no_alarm_with_sensors_or_without(aggregator: Aggregator) -> None:
    assert report(aggregator, 0.0) == OK
    assert report(aggregator, 1.0, sensor_front=OK) == OK


def test_a_warning_that_is_over_is_forgotten(aggregator: Aggregator) -> None:
    assert report(aggregator, 0.0, clock=WARN) == WARN
    assert report(aggregator, 6.0) == OK


@each("subject", [subject.replace(" ", "_") for subject in PLACES])
def test_each_error_is_the_robots(subject: str) -> None:
    assert report(load_aggregator(), 0.0, **{subject: ERROR}) == ERROR


def test_a_sensor_that_hangs_is_an_error(aggregator: Aggregator) -> None:
    assert report(aggregator, 0.0, sensor_front=STALE) == ERROR
    assert report(aggregator, 1.0, sensor_front=OK) == OK
    assert report(aggregator, 9.0) == ERROR


def test_a_node_that_died_is_an_error(aggregator: Aggregator) -> None:
    assert report(aggregator, 0.0, sensor_front=OK) == OK
    assert aggregator.level(6.0) == ERROR
