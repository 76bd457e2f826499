"""The node stays with the board that it began with."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from lifecycle_msgs.msg import Transition

from support.core_device import CoreDevice
from support.pty_device import PtyDevice
from support.ros import Diagnostics, Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, twist
from wheelwire_protocol.types import SetWheelVelocity

OK, ERROR = DiagnosticStatus.OK, DiagnosticStatus.ERROR
FIRST, OTHER = 0x240AC4123456, 0x240AC4ABCDEF


def is_driven(device: CoreDevice) -> bool:
    """Whether it has obeyed motion: opening it sends a zero setpoint, too."""
    obeyed = tuple(device.obeyed)
    return any(isinstance(one, SetWheelVelocity) and one.left_mps for one in obeyed)


def test_another_board_is_reported_and_not_driven(graph: Graph, tmp_path: Path) -> None:
    """Also when the node is configured again."""
    with PtyDevice(tmp_path / "port", CoreDevice(board_id=FIRST)) as port:
        diagnostics = Diagnostics(graph)
        with RobotNode(graph, port=port.path):
            graph.wait_active()
            with Repeater(graph.publisher(Twist, "cmd_vel"), lambda: twist(0.2)):
                first = port.device
                wait(lambda: is_driven(first), "the first board is driven")
                other = port.replace(CoreDevice(seed=2, board_id=OTHER))
                diagnostics.wait("link", lambda s, _: f"{OTHER:012x}" in s.message)
                assert not other.obeyed
                first.forget()
                port.replace(first)
                diagnostics.wait("link", lambda s, _: s.level == OK)
                wait(lambda: is_driven(first), "the board of before is driven")
            assert graph.change_state(NODE, Transition.TRANSITION_DEACTIVATE)
            assert graph.change_state(NODE, Transition.TRANSITION_CLEANUP)
            port.replace(CoreDevice(board_id=OTHER))
            assert not graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)
            diagnostics.wait("link", lambda s, _: f"{FIRST:012x}" in s.message)
            port.replace(CoreDevice(board_id=FIRST))
            assert graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)


def test_any_board_is_driven_where_that_was_asked_for(graph: Graph, tmp_path: Path) -> None:
    with (
        PtyDevice(tmp_path / "port", CoreDevice(board_id=FIRST)) as port,
        RobotNode(graph, port=port.path, any_board=True) as node,
    ):
        graph.wait_active()
        commands = graph.publisher(Twist, "cmd_vel")
        with Repeater(commands, lambda: twist(0.2)):
            wait(lambda: is_driven(port.device), "the first board is driven")
            other = port.replace(CoreDevice(seed=2, board_id=OTHER))
            wait(lambda: "held: unarmed; waiting for a zero command" in node.errors(), "the line")
            time.sleep(2.0)
            # A program that keeps commanding motion does not move a robot that appears later.
            assert not other.obeyed
            assert node.errors().count("waiting for a zero command") == 1
        with Repeater(commands, lambda: twist(0.0)):
            wait(lambda: other.obeyed, "a zero command")
        with Repeater(commands, lambda: twist(0.2)):
            wait(lambda: is_driven(other), "the other board is driven")
