"""E-stop, faults, odometry's origin: by service, and what the robot makes of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from std_srvs.srv import SetBool, Trigger

from support.ros import wait
from support.ros_rig import NODE, Rig, open_rig
from support.stop_host import stopped
from wheelwire_protocol.codes import SupervisorState


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with open_rig(tmp_path_factory.mktemp("rig")) as rig:
        yield rig


def estop(rig: Rig, value: bool) -> Any:
    return rig.graph.call(SetBool, f"{NODE}/estop", data=value)


def trigger(rig: Rig, name: str) -> Any:
    return rig.graph.call(Trigger, f"{NODE}/{name}")


def test_the_estop_stops_and_holds_until_it_is_ended(rig: Rig) -> None:
    with rig.driving():
        rig.truth(lambda state: state.drive_on)
        assert estop(rig, True).success
        assert rig.simulator.get("state") == SupervisorState.ESTOPPED
        rig.diagnostics.wait("robot", lambda s, _: s.level == DiagnosticStatus.ERROR)
        assert rig.ignored("estopped") > 0
        assert not rig.simulator.get("drive_on")
        assert estop(rig, False).success
        # A program that keeps commanding motion during the clear does not drive.
        rig.ignored("unarmed")
        assert not rig.simulator.get("drive_on")
    rig.arm()
    with rig.driving():
        rig.truth(lambda state: state.drive_on)


def test_an_open_contact_is_an_estop_that_cannot_be_ended(rig: Rig) -> None:
    rig.simulator.set("estop_open", 1)
    rig.truth(lambda state: state.state is SupervisorState.ESTOPPED)
    answer = estop(rig, False)
    assert not answer.success
    assert "refused" in answer.message
    rig.simulator.set("estop_open", 0)
    wait(lambda: estop(rig, False).success, "the end of the e-stop")
    rig.arm()


def test_a_fault_is_named_and_cleared(rig: Rig) -> None:
    rig.simulator.set("left.encoder_dead", 1)
    with rig.driving():
        rig.truth(lambda state: state.state is SupervisorState.FAULT)
        fault = rig.diagnostics.wait("robot", lambda s, _: s.level == DiagnosticStatus.ERROR)
        assert "LEFT_NOT_COUNTING" in fault["faults"]
        assert rig.ignored("refused") > 0
    rig.simulator.set("left.encoder_dead", 0)
    assert trigger(rig, "clear_fault").success
    rig.arm()
    with rig.driving():
        rig.truth(lambda state: state.drive_on)


def test_the_odometry_restarts_where_the_robot_is(rig: Rig) -> None:
    with rig.driving():
        rig.truth(lambda state: state.drive_on)
        wait(lambda: rig.x_m() > 0.1, "10 cm")
    rig.truth(stopped)
    # Samples of the last centimetres may come later than the truth.
    rig.wait_past(1.0)  # as may a command that was on its way
    wait(lambda: abs(rig.odometry[-1].twist.twist.linear.x) < 1e-3, "standstill in odom")
    assert trigger(rig, "reset_odometry").success
    rig.wait_past(0.0)
    position = rig.odometry[-1].pose.pose.position
    assert (position.x, position.y) == pytest.approx((0, 0), abs=0.002)


def test_saving_is_refused_while_driving_with_the_reason(rig: Rig) -> None:
    with rig.driving():
        rig.truth(lambda state: state.drive_on)
        answers = []

        def refused() -> bool:
            """On a busy computer a command comes too late now and then, and the robot stands."""
            answers.append(trigger(rig, "save_parameters"))
            return not answers[-1].success

        wait(refused, "the refusal")
    assert "refused" in answers[-1].message
