"""Transitions by service, the start without being asked, and signals at the start and the end."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

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
CYCLES = 8


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


def test_a_refused_transition_changes_nothing_and_an_estop_outlives_a_cleanup(graph: Graph) -> None:
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


CODE = """
import importlib, os, signal, threading
importlib.import_module("wheelwire_ros.{module}")
from wheelwire_ros.__main__ import main
threading.Timer({delay_s}, os.kill, [os.getpid(), signal.SIGINT]).start()
main()
"""
"""The moment counts from the beginning of the executable, whatever the computer is doing."""
MOMENTS = [
    # It reads its modules for about a second.
    *((0.02 + 0.2 * count, "__main__") for count in range(6)),
    *((0.02 + 0.06 * count, "hardware_robot") for count in range(8)),
]
"""When, once it has read a module."""
DRIVERS: tuple[dict[str, Any], ...] = ({"driver_type": "mock"}, {"port": "/dev/none"})


@pytest.mark.parametrize(("count", "moment"), list(enumerate(MOMENTS)))
def test_it_ends_at_once_and_cleanly(graph: Graph, count: int, moment: tuple[float, str]) -> None:
    delay_s, module = moment
    code = CODE.format(delay_s=delay_s, module=module)
    node = RobotNode(graph, code, **DRIVERS[count % 2])
    with node:
        assert node.process.wait(TIMEOUT_S) == 0
    assert "Traceback" not in node.errors_at_end


IGNORED = """
import os, signal, sys, weakref
from wheelwire_ros.__main__ import main

class Module:
    pass

class Finder:
    module = Module()

    def find_spec(self, name, path=None, target=None):
        if name == "wheelwire_ros.hardware_robot":
            self.reference = weakref.ref(Finder.module, interrupt)
            del Finder.module

def interrupt(_):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):
            pass
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        raise

sys.meta_path.insert(0, Finder())
main()
"""
"""Python ignores what a weak reference's callback raises, such as that of an import's lock."""


def test_it_ends_by_a_signal_whose_exception_python_ignores(graph: Graph) -> None:
    with RobotNode(graph, IGNORED, driver_type="mock") as node:
        assert node.process.wait(TIMEOUT_S) == 0
    assert "interrupted" in node.errors_at_end
    assert "Traceback" not in node.errors_at_end


TWICE = """
import os, signal, threading, time
from rclpy.signals import (
    SignalHandlerGuardCondition, SignalHandlerOptions, get_current_signal_handlers_options
)
from wheelwire_ros import hardware_robot

destroy = SignalHandlerGuardCondition.destroy

def checked_destroy(condition):
    if get_current_signal_handlers_options() != SignalHandlerOptions.NO:
        os._exit(3)  # rclpy's thread may be about to trigger it
    destroy(condition)

SignalHandlerGuardCondition.destroy = checked_destroy

def interrupt_twice():
    for number in (signal.SIGINT, signal.SIGTERM):
        os.kill(os.getpid(), number)
        time.sleep({pause_s})

class Opening(hardware_robot.HardwareRobot):
    def open_driver(self):
        threading.Timer({delay_s}, interrupt_twice).start()
        return super().open_driver()

hardware_robot.HardwareRobot = Opening
hardware_robot.main()
"""
"""Ctrl-C, then the signal of an impatient launch file."""


@pytest.mark.parametrize("pause_s", [0.0, 0.02])
@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.4])
def test_a_second_signal_does_not_disturb_its_end(
    graph: Graph, delay_s: float, pause_s: float
) -> None:
    node = RobotNode(graph, TWICE.format(delay_s=delay_s, pause_s=pause_s), port="/dev/none")
    with node:
        assert node.process.wait(TIMEOUT_S) == 0
    assert "Traceback" not in node.errors_at_end
