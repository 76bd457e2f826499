"""The device goes away and comes back, or another one comes, while the node runs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist
from lifecycle_msgs.msg import Transition
from std_srvs.srv import SetBool

from support import stop_host
from support.core_device import CoreDevice
from support.pty_device import PtyDevice
from support.ros import Diagnostics, Graph, Repeater, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, Rig, open_rig, stamp_s, twist
from support.stop_host import stopped
from wheelwire_protocol.codes import SupervisorState
from wheelwire_protocol.types import SetWheelVelocity

LIMIT_MPS = 0.25
JUMP_M = 0.05
"""Odometry that follows another boot's ticks jumps by more than this."""
OK, ERROR, STALE = DiagnosticStatus.OK, DiagnosticStatus.ERROR, DiagnosticStatus.STALE


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


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    directory = tmp_path_factory.mktemp("rig")
    with open_rig(directory, stamped=True, max_velocity_mps=LIMIT_MPS) as rig:
        yield rig


HELD = "held: unarmed; waiting for a zero command, or for a pause of 1 s"


def longest_jump_m(rig: Rig) -> float:
    """Beyond what can be driven between two messages of odom, since it was cleared."""
    jumps = []
    for a, b in pairwise(tuple(rig.odometry)):
        start, end = a.pose.pose.position, b.pose.pose.position
        driven_m = math.hypot(end.x - start.x, end.y - start.y)
        jumps.append(driven_m - LIMIT_MPS * (stamp_s(b) - stamp_s(a)))
    return max(jumps)


def test_unplugged_it_says_so_and_goes_on_when_plugged_in(rig: Rig) -> None:
    with rig.driving():
        rig.truth(lambda state: state.drive_on)
        rig.simulator.unplug()
        rig.diagnostics.wait("link", lambda status, _: status.level == ERROR)
        rig.diagnostics.wait("robot", lambda status, _: status.level == STALE)
        rig.truth(stopped)
        assert rig.ignored("out_of_reach") > 0
        result = rig.graph.set_parameter(NODE, "integral_gain", 20.0)
        assert not result.successful
        assert result.reason
        assert rig.graph.set_parameter(NODE, "linear.x.max_velocity", 5.0).successful
    rest = rig.simulator.get("true.left_ticks")
    rig.simulator.plug()
    link = rig.diagnostics.wait("link", lambda status, _: status.level == OK)
    assert int(link["reconnects"]) == 1
    assert rig.simulator.get("true.left_ticks") == rest  # nothing was stored for later
    with rig.driving():
        rig.truth(lambda state: state.drive_on)
    end = rig.truth(stopped)
    wait(lambda: abs(rig.x_m() - end.x_m) < 0.01, "odom where the robot is")


def test_reset_it_is_held_and_goes_on_with_the_parameters_that_were_given(rig: Rig) -> None:
    rig.odometry.clear()
    with rig.driving():
        rig.truth(lambda state: state.drive_on)
        boot_id = rig.simulator.reset()
        rig.truth(lambda state: state.boot_id == boot_id)
        rig.simulator.take_states()
        held = rig.diagnostics.wait("commands", lambda status, _: HELD in status.message)
        wait(lambda: HELD in rig.node.errors(), "the line")
        # Longer than the pause, which each command restarts.
        wait(lambda: rig.ignored("unarmed") > int(held["ignored_unarmed"]) + 30, "more of them")
        assert not any(state.drive_on for state in rig.simulator.take_states())
        assert rig.node.errors().count(HELD) == 1
    rig.arm()
    with rig.driving():
        rig.truth(lambda state: state.left_mps > LIMIT_MPS / 2)
        rig.diagnostics.wait("commands", lambda status, _: status.level == OK)
        rig.diagnostics.wait(
            "link",
            # The link knows of the reset first, the odometry with the next sample.
            lambda _, values: values["device_resets"] == values["odometry_rebases"] == "1",
        )
        rig.simulator.take_states()
        rig.wait_past(0.5)
        fastest = max(state.left_mps for state in rig.simulator.take_states())
        assert fastest == pytest.approx(LIMIT_MPS, abs=0.03)  # SPEED_MPS was commanded
    rig.truth(stopped)
    assert longest_jump_m(rig) < JUMP_M


def test_an_estop_outlives_a_reset_of_the_device(rig: Rig) -> None:
    """The device forgets it; the node sets it again before anything else."""
    assert rig.graph.call(SetBool, f"{NODE}/estop", data=True).success
    with rig.driving():
        boot_id = rig.simulator.reset()
        rig.truth(lambda state: state.boot_id == boot_id)
        latched = stop_host.wait(
            rig.simulator, lambda state: state.drive_on or state.state is SupervisorState.ESTOPPED
        )
    assert not latched.drive_on
    wait(lambda: rig.graph.call(SetBool, f"{NODE}/estop", data=False).success, "the new session")
    rig.arm()
