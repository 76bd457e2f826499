"""cmd_vel_timeout against the longest life that the robot gives a command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist

from support import stop_host
from support.ros import Diagnostics, Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, SPEED_MPS, TRUTH_HZ, twist
from wheelwire import open_driver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol.codes import SupervisorState

DEFAULT_TTL_MAX_S = 1.0
SAVED_S = 0.3


def names_both(text: str) -> bool:
    return "cmd_vel_timeout" in text and "ttl_max_s" in text


@pytest.mark.parametrize(
    ("given", "cure"),
    [
        ({"cmd_vel_timeout": 2.0}, ("ttl_max_s", 2.0)),
        ({"ttl_max_s": SAVED_S}, ("cmd_vel_timeout", SAVED_S)),
    ],
)
def test_a_longer_one_is_refused_at_the_start_until_it_is_right(
    graph: Graph, simulator: Simulator, given: dict[str, Any], cure: tuple[str, float]
) -> None:
    diagnostics = Diagnostics(graph)
    with RobotNode(graph, port=simulator.port, **given) as node:
        diagnostics.wait(
            "link", lambda s, _: s.level == DiagnosticStatus.ERROR and names_both(s.message)
        )
        graph.wait_state(NODE, "unconfigured")  # between two attempts
        wait(lambda: names_both(node.errors()), "the line")
        assert graph.set_parameter(NODE, *cure).successful
        graph.wait_active()


def test_a_robot_that_comes_back_with_a_lower_limit_is_not_driven_until_it_is_right(
    graph: Graph, tmp_path: Path
) -> None:
    with Simulator(link=tmp_path / "port", truth_hz=TRUTH_HZ) as simulator:
        with open_driver("serial", port=simulator.port) as robot:
            robot.parameters.set("ttl_max_s", SAVED_S)
            robot.parameters.save()
            robot.parameters.set("ttl_max_s", DEFAULT_TTL_MAX_S)
        diagnostics = Diagnostics(graph)
        with RobotNode(graph, port=simulator.port) as node:
            graph.wait_active()
            with Repeater(graph.publisher(Twist, "cmd_vel"), lambda: twist(SPEED_MPS)):
                stop_host.wait(simulator, lambda state: state.drive_on)
                simulator.reset()
                diagnostics.wait(
                    "link", lambda s, _: s.level == DiagnosticStatus.ERROR and names_both(s.message)
                )
                wait(lambda: names_both(node.errors()), "the line")
                simulator.take_states()
                diagnostics.wait("link", lambda s, _: s.level == DiagnosticStatus.ERROR)
                assert not any(state.drive_on for state in simulator.take_states())
                assert graph.set_parameter(NODE, "cmd_vel_timeout", SAVED_S).successful
                wait(lambda: "held: unarmed" in node.errors(), "the hold after the reset")
                assert not any(state.drive_on for state in simulator.take_states())
            with Repeater(graph.publisher(Twist, "cmd_vel"), lambda: twist(0.0)):
                stop_host.wait(simulator, lambda state: state.state is SupervisorState.DRIVING)
            with Repeater(graph.publisher(Twist, "cmd_vel"), lambda: twist(SPEED_MPS)):
                stop_host.wait(simulator, lambda state: state.drive_on)
                diagnostics.wait("link", lambda s, _: s.level == DiagnosticStatus.OK)
