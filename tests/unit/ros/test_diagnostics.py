"""With the message packages; without rclpy."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import pytest

pytest.importorskip(
    "diagnostic_msgs.msg", reason="`make ros` brings ROS's messages (Linux, x86-64)"
)

from diagnostic_msgs.msg import DiagnosticStatus

from support.host_samples import sample
from wheelwire import BaseDriver, LinkLost, LinkStatistics
from wheelwire_protocol.codes import Fault, SupervisorState
from wheelwire_protocol.types import ControlCounters
from wheelwire_ros import diagnostics
from wheelwire_ros.commands import CommandGate, CommandIgnored, Ignored
from wheelwire_ros.connection import RobotConnection, Tuning
from wheelwire_ros.diagnostics import Report

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN
ERROR, STALE = DiagnosticStatus.ERROR, DiagnosticStatus.STALE


class Robot:
    """Only what diagnostics ask a driver that has no device."""

    statistics = LinkStatistics(sessions=2, round_trip_p50_us=812.5)


class CountingRobot(Robot):
    """It has a device."""

    def latest_control_counters(self) -> ControlCounters:
        return ControlCounters(7, 7, 1, 2, 3, 4, 5)


def report(**changes: Any) -> Report:
    robot = cast("BaseDriver", Robot())
    connection = RobotConnection(robot, CommandGate(0.5), {}, Tuning(), lambda: None)
    return replace(Report(connection, sample(), None, 1e-6, 0, []), **changes)


def statuses(report: Report) -> dict[str, Any]:
    found = diagnostics.open_statuses("robot1/hardware_robot", "mock", report)
    return {status.name.removeprefix("robot1/hardware_robot: "): status for status in found}


def values(status: Any) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


def test_without_a_robot_there_is_the_reason() -> None:
    (status,) = diagnostics.closed_status("hardware_robot", "serial", "no such port")
    assert (status.name, status.level) == ("hardware_robot: link", ERROR)
    assert status.message == "no such port"


def test_what_is_in_order() -> None:
    found = statuses(report(sample=sample(state=SupervisorState.DRIVING)))
    assert [status.level for status in found.values()] == [OK, OK, OK]
    link = values(found["link"])
    assert (link["driver"], link["sessions"], link["round_trip_p50_us"]) == ("mock", "2", "812.5")
    assert math.isnan(Robot.statistics.clock_error_us)
    assert link["clock_error_us"] == ""


def test_what_the_control_loop_lost_is_told_as_of_the_last_time() -> None:
    assert "latest_step_us" not in values(statuses(report())["robot"])
    robot = CountingRobot()
    connection = RobotConnection(
        cast("BaseDriver", robot), CommandGate(0.5), {}, Tuning(), lambda: None
    )
    told = values(statuses(report(connection=connection))["robot"])
    assert (told["late_steps"], told["latest_step_us"], told["saturated_steps"]) == ("1", "2", "3")
    assert (told["left_illegal_transitions"], told["right_illegal_transitions"]) == ("4", "5")


def test_a_silence_is_the_links_and_makes_the_rest_stale() -> None:
    found = statuses(report(silence=LinkLost("unplugged")))
    assert (found["link"].level, found["link"].message) == (ERROR, "unplugged")
    assert found["robot"].level == STALE


def test_faults_by_name_and_meaning() -> None:
    fault = Fault.LEFT_NOT_COUNTING
    status = statuses(report(sample=sample(faults=fault)))["robot"]
    assert (status.level, values(status)["faults"]) == (ERROR, "LEFT_NOT_COUNTING")
    assert status.message == fault.doc


class WarningRobot(Robot):
    """Its board is not confirmed, and it rolls."""

    warnings = ("Nobody has confirmed it.",)
    rolling_mps: float | None = 0.5


class LostRobot(Robot):
    """It is out of reach."""

    @property
    def warnings(self) -> tuple[str, ...]:
        raise LinkLost("unplugged")


def of(robot: Robot) -> Report:
    connection = RobotConnection(
        cast("BaseDriver", robot), CommandGate(0.5), {}, Tuning(), lambda: None
    )
    return report(connection=connection)


def test_what_the_board_and_rolling_warn_of_is_told_as_long_as_it_lasts() -> None:
    robot = WarningRobot()
    status = statuses(of(robot))["robot"]
    assert status.level == WARN
    assert status.message == (
        "The robot rolls at 0.50 m/s although nothing drives it. Nobody has confirmed it."
    )
    robot.rolling_mps = None
    assert statuses(of(robot))["robot"].message == "Nobody has confirmed it."
    assert statuses(of(LostRobot()))["robot"].level == OK  # the link's status tells


def test_what_was_ignored_by_reason() -> None:
    one = report()
    one.connection.gate.count(CommandIgnored(Ignored.STALE))
    status = statuses(one)["commands"]
    assert values(status) == {"obeyed": "0", "ignored": "1", "ignored_stale": "1"}


def test_commands_that_nobody_hears() -> None:
    status = statuses(report(ignored_types=["geometry_msgs/msg/Twist"]))["commands"]
    assert status.level == WARN
    assert "cmd_vel_type" in status.message
