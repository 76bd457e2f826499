"""Which commands are obeyed, for how long, and within which limits; of which type cmd_vel is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from lifecycle_msgs.msg import Transition
from std_srvs.srv import SetBool

from support import stop_host
from support.ros import Diagnostics, Graph, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, TRUTH_HZ, Rig, open_rig, twist
from support.stop_host import stopped
from wheelwire.simulation.simulator import Simulator

CLOCK_ERROR_US = 10_000
CMD_VEL_TIMEOUT_S, LONG_S = 0.5, 5.0
HARDLY = 0.001
"""With a deceleration of this, a robot would not stop within the test."""
LIMITED: dict[str, Any] = {
    f"{axis}__{name}": value
    for axis in ("linear__x", "angular__z")
    for name, value in (
        ("max_acceleration", 100.0),
        ("max_deceleration", -HARDLY),
        ("max_deceleration_reverse", HARDLY),
    )
}


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


def message_of(type_: Any) -> Any:
    """A command of either type, without a stamp."""
    return twist(0.3) if type_ is Twist else TwistStamped(twist=twist(0.3))


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


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    directory = tmp_path_factory.mktemp("rig")
    with open_rig(
        directory,
        stamped=True,
        publish_limited_velocity=True,
        cmd_vel_timeout=CMD_VEL_TIMEOUT_S,
        ttl_max_s=LONG_S,
        **LIMITED,
    ) as rig:
        yield rig


def test_an_old_command_lives_for_the_rest_of_the_timeout(rig: Rig) -> None:
    age_s = 0.2
    rig.wait_past(0.3)  # a command older than the connection is ignored
    rig.simulator.take_states()
    rig.commands.publish(rig.stamped(0.3, age_s))
    start = rig.truth(lambda state: state.drive_on)
    rest_us = (CMD_VEL_TIMEOUT_S - age_s) * 1e6
    assert 0 < start.deadline_us - start.device_us <= rest_us + CLOCK_ERROR_US
    rig.truth(stopped)


def stop_by_zero(rig: Rig) -> None:
    rig.commands.publish(rig.command(0.0))


def stop_by_silence(_rig: Rig) -> None:
    return


def stop_by_estop(rig: Rig) -> None:
    # On a busy computer no answer may come within the second that a call waits for it.
    wait(lambda: rig.graph.call(SetBool, f"{NODE}/estop", data=True).success, "the e-stop")


def stop_by_deactivation(rig: Rig) -> None:
    assert rig.graph.change_state(NODE, Transition.TRANSITION_DEACTIVATE)


@pytest.mark.parametrize(
    "stop", [stop_by_zero, stop_by_silence, stop_by_estop, stop_by_deactivation]
)
def test_no_stop_waits_for_a_limit(rig: Rig, stop: Callable[[Rig], None]) -> None:
    with rig.driving():
        rig.truth(lambda state: state.left_mps > 0.2)
    stop(rig)
    rig.truth(stopped)
    rig.graph.call(SetBool, f"{NODE}/estop", data=False)
    if stop is stop_by_estop:
        rig.arm()
    if stop is stop_by_deactivation:
        assert rig.graph.change_state(NODE, Transition.TRANSITION_ACTIVATE)
