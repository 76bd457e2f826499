"""Which commands are obeyed, and for how long. Each command says so by its age."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped

from support import stop_host
from support.ros import Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import TRUTH_HZ, Rig, open_rig, twist
from support.stop_host import stopped
from wheelwire.simulation.simulator import Simulator

CMD_VEL_TIMEOUT_S = 0.5
CLOCK_ERROR_US = 10_000

TELEOPERATION = """
import rclpy
from geometry_msgs.msg import Twist
rclpy.init()
node = rclpy.create_node("teleoperation")
node.create_publisher(Twist, "cmd_vel", 1)
try:
    rclpy.spin(node)
except KeyboardInterrupt:
    pass
"""

DRIVING = """
import rclpy
from geometry_msgs.msg import Twist, TwistStamped
rclpy.init()
node = rclpy.create_node("driving")
publisher = node.create_publisher({type}, "cmd_vel", 1)
message = {type}()
(message if {type} is Twist else message.twist).linear.x = 0.3
node.create_timer(0.05, lambda: publisher.publish(message))
try:
    rclpy.spin(node)
except KeyboardInterrupt:
    pass
"""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with open_rig(
        tmp_path_factory.mktemp("rig"), stamped=True, cmd_vel_timeout=CMD_VEL_TIMEOUT_S
    ) as rig:
        yield rig


def test_a_stale_stamp_is_ignored_and_counted(rig: Rig) -> None:
    ticks = rig.simulator.get("true.left_ticks")
    rig.commands.publish(rig.stamped(0.3, age_s=CMD_VEL_TIMEOUT_S + 0.1))
    assert rig.ignored("stale") == 1
    assert rig.simulator.get("true.left_ticks") == ticks


def test_an_old_command_lives_for_the_rest_of_the_timeout(rig: Rig) -> None:
    age_s = 0.2
    seen = len(rig.odometry)  # a command older than the connection is ignored
    wait(lambda: len(rig.odometry) > seen + 15, "0.3 s of odom")
    rig.simulator.take_states()
    rig.commands.publish(rig.stamped(0.3, age_s))
    start = rig.truth(lambda state: state.drive_on)
    rest_us = (CMD_VEL_TIMEOUT_S - age_s) * 1e6
    assert 0 < start.deadline_us - start.device_us <= rest_us + CLOCK_ERROR_US
    rig.truth(stopped)


@pytest.mark.parametrize("age_s", [-3600.0, None])
def test_no_stamp_means_now_and_one_from_the_future_gains_no_life(
    rig: Rig, age_s: float | None
) -> None:
    rig.simulator.take_states()
    message = TwistStamped(twist=twist(0.3)) if age_s is None else rig.stamped(0.3, age_s)
    rig.commands.publish(message)
    start = rig.truth(lambda state: state.drive_on)
    assert start.deadline_us - start.device_us <= CMD_VEL_TIMEOUT_S * 1e6 + CLOCK_ERROR_US
    rig.truth(stopped)


def test_what_is_not_finite_is_ignored_and_counted(rig: Rig) -> None:
    rig.commands.publish(rig.stamped(math.nan))
    assert rig.ignored("invalid") == 1


@pytest.mark.parametrize("type_", [Twist, TwistStamped])
def test_the_first_publisher_decides_the_type(tmp_path: Path, graph: Graph, type_: Any) -> None:
    """And a second type is an error in the log, until the first one is gone."""
    other = TwistStamped if type_ is Twist else Twist
    name = f"geometry_msgs/msg/{other.__name__}"
    with (
        Simulator(link=tmp_path / "port", truth_hz=TRUTH_HZ) as simulator,
        RobotNode(graph, port=simulator.port) as node,
        ExitStack() as later,
    ):
        graph.wait_active()
        publisher = graph.publisher(type_, "cmd_vel")
        with Repeater(publisher, lambda: message_of(type_)):
            stop_host.wait(simulator, lambda state: state.drive_on)
            later.enter_context(RobotNode(graph, DRIVING.format(type=other.__name__)))
            wait(lambda: f"type {name} are dropped" in node.errors(), "the error")
        graph.destroy(publisher)
        wait(lambda: f"cmd_vel is {name}\n" in node.errors(), "the new type")
        simulator.take_states()
        stop_host.wait(simulator, lambda state: state.drive_on)


def message_of(type_: Any) -> Any:
    """A command of either type, without a stamp."""
    return twist(0.3) if type_ is Twist else TwistStamped(twist=twist(0.3))


def test_commands_of_the_other_type_are_reported(rig: Rig) -> None:
    with RobotNode(rig.graph, TELEOPERATION):
        rig.diagnostics.wait(
            "commands",
            lambda status, _: (
                status.level == DiagnosticStatus.WARN and "msg/Twist " in status.message
            ),
        )
    rig.diagnostics.wait("commands", lambda status, _: status.level == DiagnosticStatus.OK)
