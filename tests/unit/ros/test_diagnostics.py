"""What the statuses say, without a node."""

from __future__ import annotations

import math
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="`make ros` brings ROS 2 (Linux on x86-64 only)")

from diagnostic_msgs.msg import DiagnosticStatus

from support.cases import each
from support.host_samples import sample
from support.linkless_robot import LinklessRobot
from wheelwire import HeldBy, LastStop, LinkLost, LinkStatistics, WheelSample
from wheelwire_protocol.codes import EstopSource, Fault, Held, StopCause, SupervisorState
from wheelwire_protocol.types import ControlCounters, MemoryValue
from wheelwire_ros import diagnostics
from wheelwire_ros.diagnostics import FORGOTTEN_S, TwinWatch
from wheelwire_ros.robot_connection import Ignored, RobotConnection, Tuning
from wheelwire_ros.robot_state import ResetWatch, View, of_robot

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
ERROR, STALE = DiagnosticStatus.ERROR, DiagnosticStatus.STALE


class Robot(LinklessRobot):
    """It has counted."""

    statistics = LinkStatistics(sessions=2, round_trip_p50_us=812.5)


class CountingRobot(Robot):
    """It answers what only a device knows."""

    def latest_control_counters(self) -> ControlCounters:
        return ControlCounters(7, 7, 1, 2, 3, 4, 5)

    def latest_memory(self) -> MemoryValue:
        return MemoryValue(7, 7, 90_000, 80_000, 5000, 1800, 0)


class BumpedRobot(Robot):
    """Its bumper holds it."""

    held_by: HeldBy | None = HeldBy(Held.BUMPER_FRONT | Held.UNARMED_FORWARD)


class LatchedRobot(Robot):
    """Its contact has stopped it."""

    held_by: HeldBy | None = HeldBy(Held.ESTOP | Held.CONTACT, EstopSource.CONTACT)
    last_stop: LastStop | None = LastStop(StopCause.ESTOP_CONTACT)


def statuses(
    robot: Robot | None = None,
    newest: WheelSample | None = None,
    silence: LinkLost | None = None,
    ignored: Ignored | None = None,
    ignored_types: tuple[str, ...] = (),
    stop: str = "",
) -> dict[str, Any]:
    connection = RobotConnection(robot or Robot(), {}, Tuning(), lambda: None)
    connection.follow()
    if ignored is not None:
        connection.ignored[ignored] += 1
    newest = newest or sample()
    view = View(connection, newest, silence, ResetWatch(), stop=stop)
    name = "robot1/hardware_robot"
    found = diagnostics.open_statuses(name, "mock", view, {}, list(ignored_types))
    return {status.name.removeprefix("robot1/hardware_robot: "): status for status in found}


def values(status: Any) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


@pytest.mark.parametrize("state", [SupervisorState.ESTOPPED, SupervisorState.FAULT])
def test_a_latched_robot_says_why(state: SupervisorState) -> None:
    sentence = "Left wheel was held fast while driven. Look first at what touches the wheel."
    newest = sample(state=state, faults=Fault.LEFT_NOT_COUNTING)
    robot = statuses(newest=newest, stop=sentence)["robot"]
    assert (robot.level, robot.message) == (ERROR, sentence)
    assert values(robot)["stop"] == sentence
    assert statuses(newest=newest)["robot"].message


def test_the_cause_of_a_hold_is_a_warning_with_its_code() -> None:
    robot = statuses(BumpedRobot(), newest=sample(state=SupervisorState.DRIVING))["robot"]
    assert (robot.level, robot.message) == (WARN, Held.BUMPER_FRONT.doc)
    assert values(robot)["held_by"] == "BUMPER_FRONT UNARMED_FORWARD"


def test_the_state_names_what_holds_it_and_who_latched_it() -> None:
    connection = RobotConnection(LatchedRobot(), {}, Tuning(), lambda: None)
    connection.follow()
    newest = sample(state=SupervisorState.ESTOPPED)
    state = of_robot(View(connection, newest, None, ResetWatch()))
    assert state.cause == "the e-stop was set by its contact"
    told = values(state.message("node"))
    assert told["held_by"] == "CONTACT ESTOP"
    assert told["last_stop"] == f"ESTOP_CONTACT: {StopCause.ESTOP_CONTACT.doc}"


def test_without_a_robot_there_is_the_reason() -> None:
    (status,) = diagnostics.closed_status("hardware_robot", "serial", "no such port")
    assert (status.name, status.level) == ("hardware_robot: link", ERROR)
    assert status.message == "no such port"


@each("state", [SupervisorState.IDLE, SupervisorState.DRIVING, SupervisorState.TIMED_OUT])
def test_what_is_in_order(state: SupervisorState) -> None:
    found = statuses(newest=sample(state=state))
    assert [status.level for status in found.values()] == [OK, OK, OK]
    link = values(found["link"])
    assert (link["driver"], link["sessions"], link["round_trip_p50_us"]) == ("mock", "2", "812.5")
    assert math.isnan(Robot.statistics.clock_error_us)
    assert link["clock_error_us"] == ""


def test_diagnostics_show_the_latest_control_counters() -> None:
    assert "latest_step_us" not in values(statuses()["robot"])
    told = values(statuses(CountingRobot())["robot"])
    assert (told["late_steps"], told["latest_step_us"], told["saturated_steps"]) == ("1", "2", "3")
    assert told["free_heap_bytes"] == "90000"
    assert told["least_free_heap_bytes"] == "80000"
    assert told["least_free_stack_bytes"] == "1800"
    assert (told["left_illegal_transitions"], told["right_illegal_transitions"]) == ("4", "5")


def test_a_silence_is_the_links_and_makes_the_rest_stale() -> None:
    found = statuses(silence=LinkLost("unplugged"))
    assert (found["link"].level, found["link"].message) == (ERROR, "unplugged")
    assert found["robot"].level == STALE


def test_faults_by_name_and_meaning() -> None:
    fault = Fault.LEFT_NOT_COUNTING
    status = statuses(newest=sample(faults=fault))["robot"]
    assert (status.level, values(status)["faults"]) == (ERROR, "LEFT_NOT_COUNTING")
    assert status.message == fault.doc


class WarningRobot(Robot):
    """Its board is not confirmed, and it rolls."""

    warnings: tuple[str, ...] = ("Nobody has confirmed it.",)
    rolling_mps: float | None = 0.5


class LostRobot(Robot):
    """It is out of reach."""

    @property
    def warnings(self) -> tuple[str, ...]:
        raise LinkLost("unplugged")


def test_warnings_of_the_board_and_of_rolling_last_as_long_as_their_cause() -> None:
    robot = WarningRobot()
    status = statuses(robot)["robot"]
    assert status.level == WARN
    assert status.message == (
        "The robot rolls at 0.50 m/s although nothing drives it. Nobody has confirmed it."
    )
    robot.rolling_mps = None
    assert statuses(robot)["robot"].message == "Nobody has confirmed it."
    assert statuses(LostRobot())["robot"].level == OK  # the link's status tells


def test_commands_that_nobody_hears() -> None:
    status = statuses(ignored_types=("geometry_msgs/msg/Twist",))["commands"]
    assert status.level == WARN
    assert "cmd_vel_type" in status.message


def test_a_killed_node_does_not_count_as_a_second_one() -> None:
    twins = TwinWatch()
    assert not any(twins.look(2, float(now_s)) for now_s in range(int(FORGOTTEN_S)))
    assert not twins.look(1, FORGOTTEN_S)
    assert not twins.look(2, FORGOTTEN_S + 1)
    assert twins.look(2, 2 * FORGOTTEN_S + 1)
    assert not twins.look(2, 2 * FORGOTTEN_S + 2)  # reported once
    assert twins.has_twin
