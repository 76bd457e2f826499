"""Services; what each change of the robot's state reports on ~/state, in log and diagnostics."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.srv import GetState
from rcl_interfaces.msg import Log
from rcl_interfaces.srv import GetParameters
from std_srvs.srv import SetBool, Trigger

from support.pty_device import PtyDevice
from support.ros import Graph, wait
from support.ros_process import RobotNode
from support.ros_rig import NODE, Rig, State, open_rig, stands, values
from support.stop_host import stopped
from wheelwire_protocol.codes import Fault, ResetReason, SupervisorState
from wheelwire_protocol.types import Estop

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def test_everything_answers_while_the_robot_does_not(graph: Graph, tmp_path: Path) -> None:
    """A device that is there and silent: connecting to it takes seconds, again and again."""

    def ask(client: Any, request: Any) -> tuple[Any, float]:
        """The answer, and how long it took."""
        begin_s = time.monotonic()
        future = client.call_async(request)
        wait(future.done, "an answer")
        return future.result(), time.monotonic() - begin_s

    path = tmp_path / "port"
    with PtyDevice(path) as device:
        device.device.mute = True
        with (
            RobotNode(graph, port=path) as node,
            graph.client(GetParameters, f"{NODE}/get_parameters") as get,
            graph.client(GetState, f"{NODE}/get_state") as get_state,
            graph.client(SetBool, f"{NODE}/estop") as estop,
        ):
            waits_s: list[float] = []
            while len(waits_s) < 20:
                state, _ = ask(get_state, GetState.Request())
                if state.current_state.label != "configuring":
                    continue
                _, get_s = ask(get, GetParameters.Request(names=["cmd_vel_timeout"]))
                answer, estop_s = ask(estop, SetBool.Request(data=True))
                assert not answer.success
                assert "not open" in answer.message
                waits_s += [get_s, estop_s]
            # On a quiet machine milliseconds. What waits for an attempt to connect takes a second
            # on average, and two at most.
            assert sorted(waits_s)[len(waits_s) // 2] < 0.5
            device.device.mute = False
            graph.wait_active()
            wait(
                lambda: device.device.count(Estop) > 0,
                "the e-stop that was asked for before there was a robot",
            )
            assert node.process.poll() is None


def test_a_silent_port_is_distinguished_from_an_absent_one(graph: Graph, tmp_path: Path) -> None:
    state, path = State(graph), tmp_path / "port"
    with RobotNode(graph, port=path):
        told = state.wait(lambda v: "there is no such port" in v["cause"])
        assert str(path) in told.message
        graph.wait_state(NODE, "unconfigured")
        with PtyDevice(path) as device:
            device.device.mute = True
            state.wait(lambda v: f"{path} is silent" in v["cause"])
            device.device.mute = False
            state.wait(lambda v: v["link"] == "connected")
            graph.wait_active()
            device.device.mute = True
            state.wait(lambda v: "the port is there" in v["cause"])
            device.unplug()
            state.wait(lambda v: "the port is gone" in v["cause"])
            device.device.mute = False
            device.plug()
            state.wait(lambda v: v["link"] == "connected")


LIBRARY = "hardware_robot.wheelwire"
LINE = "a line of the library"
TELLING = f"""
import logging, threading, time
from wheelwire_ros import hardware_robot

def tell():
    while True:
        logging.getLogger("wheelwire").warning("{LINE}")
        time.sleep(0.1)

threading.Thread(target=tell, daemon=True).start()
hardware_robot.main()
"""
"""The node, beside which the library has something to say."""


def test_the_librarys_records_reach_rosout_and_a_loss_and_a_return_are_one_line_each(
    tmp_path: Path,
) -> None:
    with open_rig(tmp_path, code=TELLING) as rig:
        records = rig.graph.listen(Log, "/rosout")

        def logged(name: str, level: int, text: str) -> bool:
            return any(
                (record.name, record.level) == (name, level) and text in record.msg
                for record in tuple(records)
            )

        wait(lambda: logged(LIBRARY, Log.WARN, LINE), "the library's line")
        wait(lambda: "is connected: session 1" in rig.node.errors(), "the first connection")
        rig.node.forget_errors()
        rig.simulator.unplug()
        wait(lambda: logged("hardware_robot", Log.ERROR, "the port is gone"), "the loss")
        rig.diagnostics.wait("link", lambda status, _: "the port is gone" in status.message)
        rig.simulator.plug()
        rig.diagnostics.wait("link", lambda status, _: status.message == "connected")
        wait(lambda: logged("hardware_robot", Log.INFO, "is connected: session 2"), "the return")
        wait(lambda: "is connected: session 2" in rig.node.errors(), "the line of the return")
        # On a busy computer the sensor's line may be as late as this.
        others = LINE, "imu: OK"
        lines = [
            line
            for line in rig.node.errors().splitlines()
            if not any(other in line for other in others)
        ]
        # The second only where the robot takes its time to answer.
        texts = ("the port is gone", "has not answered yet", "is connected: session 2")
        told = [[text for text in texts if text in line] for line in lines]
        assert told in ([[texts[0]], [texts[2]]], [[text] for text in texts]), lines


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    with open_rig(tmp_path_factory.mktemp("rig")) as rig:
        yield rig


@pytest.fixture
def rig(shared: Rig) -> Rig:
    """One robot for all tests, ready to drive; what its node said before is forgotten."""
    shared.node.forget_errors()
    return shared


@pytest.fixture
def state(rig: Rig) -> State:
    return State(rig.graph)


def estop(rig: Rig, value: bool) -> Any:
    return rig.graph.call(SetBool, f"{NODE}/estop", data=value)


def trigger(rig: Rig, name: str) -> Any:
    return rig.graph.call(Trigger, f"{NODE}/{name}")


def drive(rig: Rig) -> None:
    with rig.driving():
        rig.truth(lambda state: state.drive_on)


def test_a_late_subscriber_gets_the_present_state(rig: Rig) -> None:
    told = State(rig.graph).wait(lambda v: v["link"] == "connected")
    assert told.level == OK
    assert values(told)["state"] == "IDLE"
    assert values(told)["session"] == "1"
    assert int(values(told)["boot_id"], 16) == rig.truth(lambda _: True).boot_id


def test_the_nodes_estop_holds_until_it_is_cleared_and_a_zero_command_arms(
    rig: Rig, state: State
) -> None:
    with rig.driving():
        rig.truth(lambda state: state.drive_on)
        assert estop(rig, True).success
        assert rig.simulator.get("state") == SupervisorState.ESTOPPED
        assert "~/estop" in state.wait(lambda v: v["state"] == "ESTOPPED").message
        rig.diagnostics.wait("robot", lambda s, _: s.level == ERROR)
        assert rig.ignored("estopped") > 0
        assert not rig.simulator.get("drive_on")
        assert estop(rig, False).success
        # A program that keeps commanding motion during the clear does not drive.
        wait(lambda: "waiting for a zero command" in rig.node.errors(), "the line")
        rig.simulator.take_states()
        time.sleep(2.0)
        assert not any(state.drive_on for state in rig.simulator.take_states())
    assert rig.ignored("unarmed") > 10
    assert rig.node.errors().count("waiting for a zero command") == 1
    assert "another program" not in rig.node.errors()
    rig.arm()
    drive(rig)


def test_an_open_contact_is_an_estop_that_cannot_be_cleared(rig: Rig, state: State) -> None:
    rig.simulator.set("estop_open", 1)
    told = state.wait(lambda v: v["state"] == "ESTOPPED")
    assert told.level == ERROR
    assert "contact" in told.message
    wait(lambda: "[ERROR]" in rig.node.errors() and "contact" in rig.node.errors(), "the line")
    rig.diagnostics.wait("robot", lambda _, v: v["state"] == "ESTOPPED")
    answer = estop(rig, False)
    assert not answer.success
    assert "refused" in answer.message
    rig.simulator.set("estop_open", 0)
    wait(lambda: estop(rig, False).success, "the end of the e-stop")
    state.wait(lambda v: v["state"] == "IDLE" and not v["cause"])
    wait(lambda: "can be driven again" in rig.node.errors(), "the line of its end")
    rig.arm()


def test_a_fault_is_described_in_words_and_returns_while_its_cause_is_there(
    rig: Rig, state: State
) -> None:
    rig.simulator.set("left.encoder_dead", 1)
    with rig.driving():
        told = state.wait(lambda v: v["state"] == "FAULT")
        assert values(told)["faults"] == "LEFT_NOT_COUNTING"
        assert Fault.LEFT_NOT_COUNTING.doc in told.message
        wait(lambda: Fault.LEFT_NOT_COUNTING.doc in rig.node.errors(), "the line of the fault")
        wait(lambda: "command ignored: the device refused" in rig.node.errors(), "the refusal")
        fault = rig.diagnostics.wait("robot", lambda s, _: s.level == ERROR)
        assert "LEFT_NOT_COUNTING" in fault["faults"]
        assert rig.ignored("refused") > 0
    answer = trigger(rig, "clear_fault")
    assert answer.success
    assert "LEFT_NOT_COUNTING" in answer.message
    assert "returns" in answer.message
    rig.arm()
    with rig.driving():
        rig.truth(lambda state: state.state is SupervisorState.FAULT)
    rig.simulator.set("left.encoder_dead", 0)
    assert trigger(rig, "clear_fault").success
    rig.arm()
    drive(rig)


def test_stopping_ends_the_drive_and_the_next_command_drives_again(rig: Rig) -> None:
    drive(rig)
    assert trigger(rig, "stop").success
    assert not rig.simulator.get("drive_on")
    rig.drive_on()


def test_the_odometry_restarts_where_the_robot_is(rig: Rig) -> None:
    assert trigger(rig, "reset_odometry").success
    rig.wait_past(0.0)  # or what came before would count as driven
    with rig.driving():
        wait(lambda: rig.x_m() > 0.1, "10 cm")
    rig.truth(stopped)
    # Samples of the last centimetres may come later than the truth.
    rig.wait_past(1.0)  # as may a command that was on its way
    wait(lambda: stands(rig.odometry), "standstill in odom")
    assert rig.x_m() > 0.1
    assert trigger(rig, "reset_odometry").success
    rig.wait_past(0.0)
    position = rig.odometry[-1].pose.pose.position
    assert (position.x, position.y) == pytest.approx((0, 0), abs=0.002)


def test_a_reset_of_the_device_is_warned_of_until_it_is_acknowledged(
    rig: Rig, state: State
) -> None:
    state.wait(lambda v: v["link"] == "connected")
    for _ in range(2):
        boot_id = f"{rig.simulator.reset(ResetReason.PANIC):08x}"
        state.wait(lambda v: v["boot_id"] == boot_id and v["link"] == "connected")  # noqa: B023
    told = state.wait(lambda v: v["resets"] == "2")
    assert told.level == WARN
    assert values(told)["reset_reason"] == "PANIC"
    assert "crashed" in told.message
    wait(lambda: rig.warnings("PANIC") == 2, "two lines")
    for _ in range(2):  # and it stays
        held = rig.diagnostics.wait("robot", lambda s, _: s.level == WARN and "PANIC" in s.message)
        assert held["resets_unacknowledged"] == "2"
    assert rig.graph.call(Trigger, f"{NODE}/clear_fault").success
    assert state.wait(lambda v: v["resets"] == "0").level == OK
    rig.diagnostics.wait("robot", lambda s, _: s.level == OK)
