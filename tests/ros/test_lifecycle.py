"""Transitions by service, and the start without being asked."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters
from std_srvs.srv import SetBool

from support.ros import TIMEOUT_S, Diagnostics, Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, SPEED_MPS, State, twist
from wheelwire.simulation.simulator import Simulator

OK, ERROR = DiagnosticStatus.OK, DiagnosticStatus.ERROR
CYCLES = 20
LONG_S = 10.0


@pytest.mark.fast
def test_the_way_through_all_states(graph: Graph, simulator: Simulator) -> None:
    diagnostics = Diagnostics(graph)
    odometry = graph.listen(Odometry, "odom")
    with RobotNode(graph, port=simulator.port, autostart=False) as node:
        diagnostics.wait("link", lambda status, _: status.message == "not configured")
        assert graph.state(NODE) == "unconfigured"

        assert graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)
        diagnostics.wait("link", lambda status, _: status.level == OK)
        commands = graph.publisher(Twist, "cmd_vel")
        # Again and again: what is published before the node has found the publisher is lost.
        with Repeater(commands, lambda: twist(SPEED_MPS)):
            diagnostics.wait("commands", lambda _, values: "ignored_inactive" in values)
        assert not odometry

        assert graph.change_state(NODE, Transition.TRANSITION_ACTIVATE)
        wait(lambda: odometry, "odom")
        assert graph.change_state(NODE, Transition.TRANSITION_DEACTIVATE)
        assert graph.change_state(NODE, Transition.TRANSITION_CLEANUP)
        wait(lambda: commands.get_subscription_count() == 0, "the subscription's end")
        assert graph.state(NODE) == "unconfigured"

        assert graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)
        assert graph.change_state(NODE, Transition.TRANSITION_ACTIVATE)
        odometry.clear()
        wait(lambda: odometry, "odom once more")
        assert graph.change_state(NODE, Transition.TRANSITION_ACTIVE_SHUTDOWN)
        # Nothing leads out of "finalized": the process ends, and its parent acts.
        assert node.process.wait(TIMEOUT_S) == 0
        assert "finalized: restart the process" in node.errors()


def test_a_finalized_node_promises_no_estop(graph: Graph, simulator: Simulator) -> None:
    state = State(graph)
    # For longer than in use, so that the client has time to ask.
    code = (
        "from wheelwire_ros import node, hardware_robot\n"
        f"node.FINALIZED_S = {LONG_S}\nhardware_robot.main()"
    )
    with RobotNode(graph, code, port=simulator.port):
        graph.wait_active()
        with graph.client(SetBool, f"{NODE}/estop") as client:
            assert graph.change_state(NODE, Transition.TRANSITION_ACTIVE_SHUTDOWN)
            state.wait(lambda values: values["cause"] == "finalized: restart the process")
            future = client.call_async(SetBool.Request(data=True))
            wait(future.done, "an answer")
        assert not future.result().success
        assert future.result().message == "there is no robot: finalized: restart the process"


def test_a_robot_opens_and_closes_while_callbacks_run(graph: Graph) -> None:
    """Its topics begin and end without disturbing the threads that wait for others."""
    client = graph.node.create_client(GetParameters, f"{NODE}/get_parameters")
    answers = 0

    def ask(_: object = None) -> None:
        nonlocal answers
        answers += 1
        client.call_async(GetParameters.Request(names=["port"])).add_done_callback(ask)

    with RobotNode(graph, driver_type="mock", publish_limited_velocity=True, autostart=False):
        wait(client.service_is_ready, "the node's parameters")
        # A node that answers a later client has found this one too.
        assert graph.state(NODE) == "unconfigured"
        for _ in range(4):
            ask()  # each answer asks again, so the node's threads never rest
        for _ in range(CYCLES):
            # A robot that gets no time to answer for a second leaves the node unconfigured.
            wait(lambda: graph.change_state(NODE, Transition.TRANSITION_CONFIGURE), "configured")
            assert graph.change_state(NODE, Transition.TRANSITION_CLEANUP)
    assert answers > CYCLES


def test_a_refused_transition_changes_nothing_and_an_estop_outlives_a_cleanup(
    graph: Graph,
) -> None:
    """Also with a driver whose supervisor ends with it."""
    diagnostics = Diagnostics(graph)
    with RobotNode(graph, driver_type="mock"):
        graph.wait_active()
        # The state has no such transition: as by a lifecycle manager that comes later.
        assert not graph.change_state(NODE, Transition.TRANSITION_CONFIGURE)
        assert graph.state(NODE) == "active"
        assert graph.call(SetBool, f"{NODE}/estop", data=True).success
        for transition in (
            Transition.TRANSITION_DEACTIVATE,
            Transition.TRANSITION_CLEANUP,
            Transition.TRANSITION_CONFIGURE,
            Transition.TRANSITION_ACTIVATE,
        ):
            assert graph.change_state(NODE, transition)
        state = diagnostics.wait("robot", lambda _, values: "state" in values)
        assert state["state"] == "ESTOPPED"
        assert graph.call(SetBool, f"{NODE}/estop", data=False).success
        diagnostics.wait("robot", lambda _, values: values.get("state") == "IDLE")


def test_a_robot_that_comes_later_is_configured_when_somebody_else_asks(
    graph: Graph, tmp_path: Path
) -> None:
    """As by Nav2's lifecycle manager, which gives up after the first failure."""
    port = tmp_path / "port"
    diagnostics = Diagnostics(graph)
    with (
        RobotNode(graph, port=port, autostart=False),
        graph.client(ChangeState, f"{NODE}/change_state") as client,
    ):
        configure = Transition(id=Transition.TRANSITION_CONFIGURE)
        future = client.call_async(ChangeState.Request(transition=configure))
        diagnostics.wait(
            "link", lambda status, _: status.level == ERROR and str(port) in status.message
        )
        assert not future.done()
        with Simulator(link=port):
            wait(future.done, "the transition")
            assert future.result().success
            assert graph.state(NODE) == "inactive"


def test_a_node_that_waits_for_its_robot_ends_when_it_is_interrupted(
    graph: Graph, tmp_path: Path
) -> None:
    state = State(graph)
    with (
        RobotNode(graph, port=tmp_path / "port", autostart=False) as node,
        graph.client(ChangeState, f"{NODE}/change_state") as client,
    ):
        configure = Transition(id=Transition.TRANSITION_CONFIGURE)
        client.call_async(ChangeState.Request(transition=configure))
        state.wait(lambda values: str(tmp_path) in values["cause"])
        assert node.end(signal.SIGINT) == 0
