"""Parameters: what they say of themselves, and whether they reach the robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from importlib.resources import as_file, files
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from nav_msgs.msg import Odometry
from std_srvs.srv import Trigger

from support.ros import TIMEOUT_S, Graph, Repeater, open_graph, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, Rig, open_rig, stamp_s, twist
from wheelwire import open_driver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.parameters import PARAMETER_BY_NAME


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with open_rig(tmp_path_factory.mktemp("rig"), max_velocity_mps=0.35) as rig:
        yield rig


def fastest_mps(rig: Rig, linear_mps: float) -> float:
    """The speed that is reached, by the plant."""
    with Repeater(rig.commands, lambda: twist(linear_mps)):
        rig.truth(lambda state: state.left_mps > 0.05)
        odometry = len(rig.odometry)
        wait(lambda: len(rig.odometry) > odometry + 50, "a second of odom")
        return max(state.left_mps for state in rig.simulator.take_states())


def test_they_describe_themselves_with_their_ranges(rig: Rig) -> None:
    gain = rig.graph.describe(NODE, "proportional_gain")
    definition = PARAMETER_BY_NAME["proportional_gain"]
    assert gain.floating_point_range[0].from_value == definition.minimum
    assert gain.floating_point_range[0].to_value == definition.maximum
    assert definition.doc in gain.description
    counts = rig.graph.describe(NODE, "counts_per_revolution")
    assert counts.integer_range[0].to_value == 200_000
    assert rig.graph.describe(NODE, "cmd_vel_timeout").floating_point_range


def test_those_that_were_not_given_are_as_the_robot_has_them(rig: Rig) -> None:
    for name in ("static_feedforward", "counts_per_revolution", "left_motor_inverted"):
        assert rig.graph.parameter(NODE, name) == PARAMETER_BY_NAME[name].default
    assert rig.graph.parameter(NODE, "max_velocity_mps") == 0.35


def test_a_limit_of_the_node_takes_effect_at_once(rig: Rig) -> None:
    assert rig.graph.set_parameter(NODE, "linear.x.max_velocity", 0.1).successful
    assert fastest_mps(rig, 0.3) == pytest.approx(0.1, abs=0.03)
    assert rig.graph.set_parameter(NODE, "linear.x.max_velocity", math.nan).successful


def test_the_customers_max_rpm_limits_the_speed_of_each_wheel(rig: Rig) -> None:
    rpm = 0.15 / 0.033 * 60 / (2 * math.pi)
    assert rig.graph.set_parameter(NODE, "max_rpm", rpm).successful
    assert fastest_mps(rig, 0.3) == pytest.approx(0.15, abs=0.03)
    assert rig.graph.set_parameter(NODE, "max_rpm", math.nan).successful


def test_a_value_that_stays_does_not_count_as_a_change(rig: Rig) -> None:
    assert rig.graph.set_parameter(NODE, "odom_frame_id", "odom").successful


def test_a_limit_of_the_robot_takes_effect_at_once(rig: Rig) -> None:
    assert rig.graph.set_parameter(NODE, "max_velocity_mps", 0.2).successful
    assert fastest_mps(rig, 0.4) == pytest.approx(0.2, abs=0.03)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("proportional_gain", -1.0, "out of range"),
        ("cmd_vel_timeout", float("nan"), "out of range"),
        ("odom_frame_id", "elsewhere", "read when the node is configured"),
        ("wheel_base", 0.3, "undeclared"),
        ("control_rate_hz", 333.0, "type"),
        ("cmd_vel_timeout", 0.0, "Min: 0.02"),
        ("linear.x.max_velocity", -0.1, "above 0.0, or .NAN"),
        ("linear.x.max_velocity", 0.0, "above 0.0, or .NAN"),
        ("angular.z.max_jerk", 0.0, "above 0.0, or .NAN"),
        ("angular.z.max_deceleration", 0.1, "at most 0.0, or .NAN"),
        ("max_rpm", 0.0, "above 0.0, or .NAN"),
        ("base_frame_id", "", "a frame has a name"),
        ("base_frame_id", "odom", "they are equal"),
        ("pose_covariance_diagonal", [0.0] * 5, "write six"),
        ("twist_covariance_diagonal", [-1.0] * 6, "at least 0"),
        ("twist_covariance_diagonal", [float("nan")] * 6, "finite"),
        ("left_wheel_names", ["a", "b"], "2 wheels on the left and 1 on the right"),
        ("open_loop", True, "does not drive without them"),
    ],
)
def test_an_impossible_value_is_refused_with_the_reason(
    rig: Rig, name: str, value: Any, reason: str
) -> None:
    result = rig.graph.set_parameter(NODE, name, value)
    assert not result.successful
    assert reason in result.reason


def test_aliases_and_changes_reach_the_firmware_and_saved_ones_stay(tmp_path: Path) -> None:
    """Read back by another host, when the node has ended."""
    with open_graph() as graph, Simulator(link=tmp_path / "port") as simulator:
        with RobotNode(
            graph, serial_port=simulator.port, wheel_base=0.25, cpr=720, max_speed=0.3
        ) as node:
            graph.wait_active()
            assert graph.parameter(NODE, "wheel_separation") == 0.25
            assert graph.set_parameter(NODE, "proportional_gain", 2.5).successful
            assert graph.call(Trigger, f"{NODE}/save_parameters").success
            assert graph.set_parameter(NODE, "proportional_gain", 3.5).successful
        assert node.process.returncode == 0
        assert gain_and_geometry(simulator) == (3.5, 0.25, 720, 0.3)
        simulator.reset()
        assert gain_and_geometry(simulator) == (2.5, 0.25, 720, 0.3)


def gain_and_geometry(simulator: Simulator) -> tuple[float, ...]:
    with open_driver("serial", port=simulator.port, connect_timeout=TIMEOUT_S) as robot:
        drive = robot.geometry
        return (
            robot.parameters["proportional_gain"],
            drive.wheel_separation,
            drive.counts_per_revolution,
            drive.max_velocity_mps,
        )


def test_unknown_parameters_are_named() -> None:
    given: dict[str, Any] = {"driver_type": "mock", "wheelradius": 0.03, "lidar_model": "A1"}
    with open_graph() as graph, RobotNode(graph, **given) as node:
        graph.wait_active()
        (warning,) = [line for line in node.errors().splitlines() if "unknown parameters" in line]
        assert "wheelradius (did you mean wheel_radius?)" in warning
        assert "lidar_model" in warning


def test_a_robots_own_file_is_no_parameter_file(graph: Graph) -> None:
    with (
        as_file(files("wheelwire.tools.files") / "pi4b_robot.yaml") as file,
        RobotNode(graph, file=file) as node,
    ):
        words = "a ROS parameter file has its values below `/**:`"
        wait(lambda: words in node.errors(), "the refusal of the file")
        graph.wait_state(NODE, "unconfigured")


def test_a_slow_odom_does_not_count_as_a_silence(graph: Graph, simulator: Simulator) -> None:
    odometry = graph.listen(Odometry, "odom")
    with RobotNode(graph, port=simulator.port, publish_rate=2.0) as node:

        def comes_without_a_silence() -> bool:
            silences, seen = node.errors().count("cannot be reached"), len(odometry)
            wait(lambda: len(odometry) > seen + 3, "some odom")
            return node.errors().count("cannot be reached") == silences

        wait(comes_without_a_silence, "odom without a silence")
    steps = [b - a for a, b in pairwise(stamp_s(message) for message in tuple(odometry))]
    assert median(steps) == pytest.approx(0.5, rel=0.05)
