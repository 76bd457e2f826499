"""Two nodes of one name."""

from __future__ import annotations

import signal
from functools import partial

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus

from support.ros import Diagnostics, Graph, wait
from support.ros_process import RobotNode
from wheelwire.simulation.simulator import Simulator


def is_said(node: RobotNode) -> bool:
    return "another node has this node's name" in node.errors()


def test_a_second_node_of_the_name_is_reported_and_a_killed_one_is_not(graph: Graph) -> None:
    diagnostics = Diagnostics(graph)
    with Simulator() as simulator, Simulator() as other:
        with RobotNode(graph, port=simulator.port) as killed:
            graph.wait_active()
            killed.end(signal.SIGKILL)
        with RobotNode(graph, port=simulator.port) as first:
            with RobotNode(graph, port=other.port) as second:
                diagnostics.wait("name", lambda status, _: status.level == DiagnosticStatus.ERROR)
                for node in (first, second):
                    wait(partial(is_said, node), "a line")
            with RobotNode(graph, port=other.port, namespace="/other") as elsewhere:
                Diagnostics(graph, "other/hardware_robot").wait("link", lambda *_: True)
                assert not is_said(elsewhere)
