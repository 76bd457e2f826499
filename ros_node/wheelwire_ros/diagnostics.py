"""The statuses in /diagnostics. Needs the message packages, not rclpy."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from wheelwire import BaseDriver, WheelSample, WheelwireError

from .connection import RobotConnection
from .time_base import WAITING_FOR_CLOCK

TWIN = (
    "another node has this node's name: both publish, and which of them answers a service, ~/estop "
    "among them, is left to chance; end one of them, or rename it (-r __node:=..., -r __ns:=...)"
)

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE

NORMAL_STATES = ("IDLE", "DRIVING", "TIMED_OUT")
"""TIMED_OUT as well: that is how every drive by hand ends, and stays until the next command."""


@dataclass(frozen=True)
class Report:
    """The data for the statuses of an open robot."""

    connection: RobotConnection
    sample: WheelSample | None
    """The newest sample."""
    silence: WheelwireError | None
    """Why no sample has come recently; None if one has."""
    ros_offset_error_s: float
    """Error bound of the ROS clock's offset."""
    rebases: int
    """How often the odometry was rebased after a reset of the device."""
    ignored_types: list[str]
    """Message types that others publish on cmd_vel but this node does not subscribe to."""
    published: int = 0
    """Samples published; fewer than came where publish_rate is below the robot's rate."""
    dropped: int = 0
    """Samples that came but were not taken within a second."""
    reset: str = ""
    """That the device was reset, until somebody acknowledges it."""
    resets: int = 0
    """How often, until then."""
    waiting_for_clock: bool = False
    """Whether motion cannot be stamped, because use_sim_time is set and /clock is silent."""


def closed_status(name: str, driver_type: str, reason: str) -> list[DiagnosticStatus]:
    """The status when the robot is not open, with the reason."""
    return [_status(f"{name}: link", ERROR, reason, "", {"driver": driver_type})]


def twin_status(name: str) -> DiagnosticStatus:
    """That another node has this one's name."""
    return _status(f"{name}: name", ERROR, TWIN, "", {})


def open_statuses(name: str, driver_type: str, report: Report) -> list[DiagnosticStatus]:
    """The statuses of link, robot and commands of an open robot."""
    robot = report.connection.robot
    identity = identity_of(robot)
    hardware = identity.get("board_id", "")
    statuses = [
        _link(name, hardware, driver_type, report, identity),
        _robot(name, hardware, report),
        _commands(name, hardware, report),
    ]
    if report.waiting_for_clock:
        statuses.append(_status(f"{name}: clock", WARN, WAITING_FOR_CLOCK, "", {}))
    return statuses


def identity_of(robot: BaseDriver) -> dict[str, str]:
    """What the driver knows about its device; empty for a driver without one."""
    info = getattr(robot, "info", None)
    if info is None:
        return {}
    device = info.device
    identity = {
        "port": info.port,
        "baud_rate": str(info.baud_rate),
        "board": device.board.name,
        "board_id": device.board_id,
        "firmware": device.release.release,
        "reset_reason": device.reset_reason.name,
    }
    if info.board is not None:
        identity["wired_to"] = info.board.name
        identity["wired_to_state"] = info.board.state.name
        identity["wired_to_fingerprint"] = f"{info.board.fingerprint:08x}"
    return identity


def last_start(robot: BaseDriver) -> tuple[str, str, str]:
    """Why the device last started, by name and in words, and its board's identity."""
    info = getattr(robot, "info", None)
    if info is None:
        return "UNKNOWN", "the driver does not tell why", ""
    reason, doc = info.device.reset_reason.name, info.device.reset_reason.doc
    return reason, doc[0].lower() + doc[1:].rstrip("."), info.device.board_id


def warnings_of(robot: BaseDriver) -> tuple[str, ...]:
    """What keeps the device from driving or makes it less safe, as of its board."""
    try:
        return tuple(getattr(robot, "warnings", ()))
    except WheelwireError:  # out of reach, which is another status
        return ()


def _rolling(robot: BaseDriver) -> tuple[str, ...]:
    rolling_mps = getattr(robot, "rolling_mps", None)
    if rolling_mps is None:
        return ()
    return (f"The robot rolls at {rolling_mps:.2f} m/s although nothing drives it.",)


def _link(
    name: str, hardware: str, driver_type: str, report: Report, identity: dict[str, str]
) -> DiagnosticStatus:
    robot = report.connection.robot
    # The silence first: it may be why a session cannot be prepared.
    problem = report.silence or report.connection.problem
    level, message = OK, "connected"
    if problem is not None:
        level, message = ERROR, str(problem)
    values = {"driver": driver_type, **identity, **asdict(robot.statistics)}
    if report.sample is not None:
        values["sample_time_error_s"] = report.sample.stamp_error_s
    values["ros_clock_offset_error_s"] = report.ros_offset_error_s
    values["odometry_rebases"] = report.rebases
    values["samples_published"] = report.published
    values["samples_dropped"] = report.dropped
    return _status(f"{name}: link", level, message, hardware, values)


def _robot(name: str, hardware: str, report: Report) -> DiagnosticStatus:
    sample, subject = report.sample, f"{name}: robot"
    if sample is None:
        return _status(subject, WARN, "no sample yet", hardware, {})
    faults = [fault for fault in type(sample.faults) if fault in sample.faults]
    values = {
        "state": sample.state.name,
        "faults": " ".join(str(fault.name) for fault in faults),
        "control_overruns": sample.overruns,
        "command_seq": sample.command_seq,
        "boot_id": f"{sample.boot_id:08x}",
        "resets_unacknowledged": report.resets,
    }
    robot = report.connection.robot
    values |= _control_counters(robot)
    if sample.battery_v is not None:
        values["battery_v"] = sample.battery_v
    # Before the silence: an e-stop of this node is in force even if the robot is not heard.
    if report.connection.estopped or sample.state.name == "ESTOPPED":
        return _status(subject, ERROR, "the e-stop is set", hardware, values)
    if report.silence is not None:
        return _status(
            subject, STALE, "the last known state; the robot is silent", hardware, values
        )
    if faults:
        return _status(subject, ERROR, " ".join(f.doc for f in faults), hardware, values)
    reset = (_sentence(report.reset),) if report.reset else ()
    warnings = (*_rolling(robot), *warnings_of(robot), *reset)
    if warnings:
        return _status(subject, WARN, " ".join(warnings), hardware, values)
    level = OK if sample.state.name in NORMAL_STATES else WARN
    return _status(subject, level, sample.state.doc, hardware, values)


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}."


def _control_counters(robot: BaseDriver) -> dict[str, Any]:
    """The latest counters of the control loop and the encoders; empty for other drivers."""
    latest = getattr(robot, "latest_control_counters", None)
    # Each call asks the robot without waiting, so this is the answer to the last report's call.
    counters = latest() if latest is not None else None
    if counters is None:
        return {}
    return {
        "late_steps": counters.late_steps,
        "latest_step_us": counters.latest_step_us,
        "saturated_steps": counters.saturated_steps,
        "left_illegal_transitions": counters.left_illegal,
        "right_illegal_transitions": counters.right_illegal,
    }


def _commands(name: str, hardware: str, report: Report) -> DiagnosticStatus:
    gate = report.connection.gate
    # Sorted by text, since the members of an Enum have no order.
    ignored = {f"ignored_{r.name.lower()}": n for r, n in sorted(gate.ignored.items(), key=str)}
    values = {"obeyed": gate.obeyed, "ignored": sum(gate.ignored.values()), **ignored}
    level, message = OK, f"{gate.obeyed} obeyed, {sum(gate.ignored.values())} ignored"
    if report.ignored_types:
        level = WARN
        message = (
            f"commands of type {', '.join(report.ignored_types)} are ignored: "
            "have all publishers publish one type, or set cmd_vel_type"
        )
    return _status(f"{name}: commands", level, message, hardware, values)


def _status(
    name: str, level: bytes, message: str, hardware_id: str, values: dict[str, Any]
) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id=hardware_id,
        values=list(_key_values(values)),
    )


def _key_values(values: dict[str, Any]) -> Iterable[KeyValue]:
    for key, value in values.items():
        if isinstance(value, float):
            text = "" if math.isnan(value) else f"{value:.6g}"
        else:
            text = str(value)
        yield KeyValue(key=key, value=text)
