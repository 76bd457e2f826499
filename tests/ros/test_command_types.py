"""Which type of cmd_vel is taken, and from whom."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped

from support import stop_host
from support.ros import Diagnostics, Graph, wait
from support.ros_process import RobotNode
from support.ros_rig import TRUTH_HZ, twist
from wheelwire.simulation.simulator import Simulator

DRIVING = """
import rclpy
from geometry_msgs.msg import Twist, TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
rclpy.init()
node = rclpy.create_node("driving")
quality = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
publisher = node.create_publisher({type}, "cmd_vel", quality)
message = {type}()
(message if {type} is Twist else message.twist).linear.x = 0.3
node.create_timer(0.05, lambda: publisher.publish(message))
try:
    rclpy.spin(node)
except KeyboardInterrupt:
    pass
"""
"""By best effort, which the node hears, too."""

PLAIN = "geometry_msgs/msg/Twist"
OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


def decided(type_: Any) -> str:
    """The line of the log."""
    return f"cmd_vel is geometry_msgs/msg/{type_.__name__}: its first message decided"


def taken(graph: Graph) -> list[str]:
    """The types that are subscribed to."""
    return [info.topic_type for info in graph.node.get_subscriptions_info_by_topic("/cmd_vel")]


@pytest.mark.parametrize("type_", [Twist, TwistStamped])
def test_the_first_message_decides_the_type(tmp_path: Path, graph: Graph, type_: Any) -> None:
    """From its first message on, until its last publisher is gone; another type is reported."""
    other = TwistStamped if type_ is Twist else Twist
    name = f"geometry_msgs/msg/{other.__name__}"
    diagnostics = Diagnostics(graph)
    with (
        Simulator(link=tmp_path / "port", truth_hz=TRUTH_HZ) as simulator,
        RobotNode(graph, port=simulator.port) as node,
    ):
        graph.wait_active()
        # There is a subscriber before any publisher, and one type on the topic all the time.
        wait(lambda: taken(graph) == [PLAIN], "a subscriber")
        publisher = graph.publisher(type_, "cmd_vel")
        # Nothing sends the only message again, if the subscription meets its publisher after it.
        graph.wait_found("/hardware_robot")
        wait(lambda: taken(graph) == [f"geometry_msgs/msg/{type_.__name__}"], "its type")
        assert dict(graph.node.get_topic_names_and_types())["/cmd_vel"] == taken(graph)
        simulator.take_states()
        publisher.publish(message_of(type_))
        stop_host.wait(simulator, lambda state: state.drive_on)
        wait(lambda: decided(type_) in node.errors(), "the line")

        with RobotNode(graph, DRIVING.format(type=other.__name__)):
            wait(lambda: f"drops messages of type {name}" in node.errors(), "the error")
            diagnostics.wait("commands", lambda s, _: s.level == WARN and f"{name}:" in s.message)
            simulator.take_states()
            graph.destroy(publisher)
            stop_host.wait(simulator, lambda state: state.drive_on)
            wait(lambda: decided(other) in node.errors(), "the new type")
            diagnostics.wait("commands", lambda s, _: s.level == OK)

        # An idle joystick locks nobody out.
        publisher = graph.publisher(type_, "cmd_vel")
        with RobotNode(graph, DRIVING.format(type=other.__name__)):
            wait(lambda: node.errors().count(decided(other)) == 2, "the type of the first message")
            simulator.take_states()
            stop_host.wait(simulator, lambda state: state.drive_on)
    assert "incompatible QoS" not in node.errors_at_end


def message_of(type_: Any) -> Any:
    """A command of either type, without a stamp."""
    return twist(0.3) if type_ is Twist else TwistStamped(twist=twist(0.3))
