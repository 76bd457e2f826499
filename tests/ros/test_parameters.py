"""Parameters: what they say of themselves, and whether they reach the robot."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from nav_msgs.msg import Odometry
from std_srvs.srv import Trigger

from support.cases import each
from support.ros import TIMEOUT_S, Graph, Repeater, open_graph, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, Rig, open_rig, stamp_s, twist
from wheelwire import open_driver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_ros.parameter_values import same


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with open_rig(tmp_path_factory.mktemp("rig"), max_velocity_mps=0.35) as rig:
        yield rig


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


def test_a_value_that_stays_does_not_count_as_a_change(rig: Rig) -> None:
    assert rig.graph.set_parameter(NODE, "odom_frame_id", "odom").successful


def test_a_limit_of_the_robot_takes_effect_at_once(rig: Rig) -> None:
    assert rig.graph.set_parameter(NODE, "max_velocity_mps", 0.2).successful
    with Repeater(rig.commands, lambda: twist(0.4)):
        rig.truth(lambda state: state.left_mps > 0.05)
        odometry = len(rig.odometry)
        wait(lambda: len(rig.odometry) > odometry + 50, "a second of odom")
        fastest_mps = max(state.left_mps for state in rig.simulator.take_states())
    assert fastest_mps == pytest.approx(0.2, abs=0.03)


@each(
    ("name", "value", "reason"),
    [
        ("proportional_gain", -1.0, "out of range"),
        ("cmd_vel_timeout", float("nan"), "out of range"),
        ("cmd_vel_timeout", 0.0, "Min: 0.02"),
        ("cmd_vel_timeout", 1.5, "ttl_max_s: a command of 1.5 s is longer"),
        ("ttl_max_s", 0.3, "cmd_vel_timeout, ttl_max_s: a command of 0.5 s is longer"),
        ("odom_frame_id", "elsewhere", "read when the node is configured"),
        ("wheel_base", 0.3, "undeclared"),
        ("control_rate_hz", 333.0, "type"),
        ("max_rpm", 0.0, "above 0.0, or .NAN"),
        ("base_frame_id", "odom", "they are equal"),
        ("left_wheel_names", ["a", "b"], "2 wheels on the left and 1 on the right"),
        ("open_loop", True, "does not drive without them"),
    ],
)
def test_an_impossible_value_is_refused_with_the_reason(
    rig: Rig, name: str, value: Any, reason: str
) -> None:
    before = rig.graph.dump(NODE)
    result = rig.graph.set_parameter(NODE, name, value)
    assert not result.successful
    assert reason in result.reason
    after = rig.graph.dump(NODE)
    assert all(same(after[one], before[one]) for one in before)


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
