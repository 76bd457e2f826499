"""Which type of cmd_vel is taken, and from whom."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy

from support import stop_host
from support.ros import Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import TRUTH_HZ, twist
from wheelwire.simulation.simulator import Simulator

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


PLAIN, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
BEST_EFFORT = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def decided(type_: Any) -> str:
    """The line of the log."""
    return f"cmd_vel is geometry_msgs/msg/{type_.__name__}: its first message decided"


def taken(graph: Graph) -> list[str]:
    """The types that are subscribed to."""
    return [info.topic_type for info in graph.node.get_subscriptions_info_by_topic("/cmd_vel")]


@pytest.mark.parametrize("type_", [Twist, TwistStamped])
def test_one_publication_drives(tmp_path: Path, graph: Graph, type_: Any) -> None:
    """There is a subscriber before any publisher, and one type on the topic all the time."""
    with (
        Simulator(link=tmp_path / "port", truth_hz=TRUTH_HZ) as simulator,
        RobotNode(graph, port=simulator.port) as node,
    ):
        graph.wait_active()
        wait(lambda: taken(graph) == [PLAIN], "a subscriber")
        publisher = graph.publisher(type_, "cmd_vel")
        # Nothing sends the only message again, if the subscription meets its publisher after it.
        graph.wait_found("/hardware_robot")
        wait(lambda: taken(graph) == [f"geometry_msgs/msg/{type_.__name__}"], "its type")
        simulator.take_states()
        publisher.publish(message_of(type_))
        stop_host.wait(simulator, lambda state: state.drive_on)
        assert taken(graph) == [f"geometry_msgs/msg/{type_.__name__}"]
        assert dict(graph.node.get_topic_names_and_types())["/cmd_vel"] == taken(graph)
        wait(lambda: decided(type_) in node.errors(), "the line")


@pytest.mark.parametrize("type_", [Twist, TwistStamped])
def test_an_idle_joystick_of_the_other_type_locks_nobody_out(
    tmp_path: Path, graph: Graph, type_: Any
) -> None:
    idle = TwistStamped if type_ is Twist else Twist
    with (
        Simulator(link=tmp_path / "port", truth_hz=TRUTH_HZ) as simulator,
        RobotNode(graph, port=simulator.port) as node,
    ):
        graph.wait_active()
        graph.publisher(idle, "cmd_vel")
        with RobotNode(graph, DRIVING.format(type=type_.__name__)):
            stop_host.wait(simulator, lambda state: state.drive_on)
            wait(lambda: decided(type_) in node.errors(), "the line")


def test_a_best_effort_publisher_is_heard(tmp_path: Path, graph: Graph) -> None:
    with (
        Simulator(link=tmp_path / "port", truth_hz=TRUTH_HZ) as simulator,
        RobotNode(graph, port=simulator.port) as node,
    ):
        graph.wait_active()
        publisher = graph.node.create_publisher(Twist, "cmd_vel", BEST_EFFORT)
        with Repeater(publisher, lambda: twist(0.3)):
            stop_host.wait(simulator, lambda state: state.drive_on)
        assert "incompatible QoS" not in node.errors()


@pytest.mark.parametrize("type_", [Twist, TwistStamped])
def test_the_first_message_decides_the_type(tmp_path: Path, graph: Graph, type_: Any) -> None:
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
            wait(lambda: f"drops messages of type {name}" in node.errors(), "the error")
        graph.destroy(publisher)
        wait(lambda: decided(other) in node.errors(), "the new type")
        simulator.take_states()
        stop_host.wait(simulator, lambda state: state.drive_on)


def message_of(type_: Any) -> Any:
    """A command of either type, without a stamp."""
    return twist(0.3) if type_ is Twist else TwistStamped(twist=twist(0.3))
