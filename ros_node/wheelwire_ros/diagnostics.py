"""The statuses in /diagnostics, and the search for another node of the same name."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from wheelwire import BaseDriver, SensorStatus, WheelwireError
from wheelwire.log.why.causes import cure_of_stores

from .robot_connection import RobotConnection
from .robot_state import ERROR, OK, WARN, RobotState, View, of_robot, status_of
from .sensors import channel_words
from .time_base import WAITING_FOR_CLOCK

TWIN = (
    "another node has this node's name: both publish, and either may answer a service such as "
    "~/estop; end one of them, or rename it (-r __node:=..., -r __ns:=...)"
)
FORGOTTEN_S = 25.0
"""A node that was killed is on the graph until its lease ends, 20 s with Fast DDS: one that
restarts must not mistake its predecessor for a second robot."""

STALE = DiagnosticStatus.STALE

NORMAL_STATES = ("IDLE", "DRIVING", "TIMED_OUT")
"""TIMED_OUT as well: every drive by hand ends so, and the robot stays so until the next command."""


class TwinWatch:
    """Whether another node of this name lives. Pure: the time is an argument."""

    def __init__(self) -> None:
        self.has_twin = False
        self._since_s = math.inf

    def look(self, nodes_of_this_name: int, now_s: float) -> bool:
        """Look at the graph; whether this look was the first to find a twin.

        Args:
            nodes_of_this_name: This one included.
            now_s: On a monotonic clock.
        """
        self._since_s = min(self._since_s, now_s) if nodes_of_this_name > 1 else math.inf
        had_twin, self.has_twin = self.has_twin, now_s - self._since_s >= FORGOTTEN_S
        return self.has_twin and not had_twin


def closed_status(name: str, driver_type: str, reason: str) -> list[DiagnosticStatus]:
    """The status when the robot is not open, with the reason."""
    return [status_of(f"{name}: link", ERROR, reason, "", {"driver": driver_type})]


def twin_status(name: str) -> DiagnosticStatus:
    """That another node has this one's name."""
    return status_of(f"{name}: name", ERROR, TWIN, "", {})


def clock_status(name: str) -> DiagnosticStatus:
    """That the node cannot stamp motion, because use_sim_time is set and /clock is silent."""
    return status_of(f"{name}: clock", WARN, WAITING_FOR_CLOCK, "", {})


def open_statuses(
    name: str,
    driver_type: str,
    view: View,
    link_values: dict[str, Any],
    ignored_types: list[str],
    channels: Sequence[SensorStatus] = (),
) -> list[DiagnosticStatus]:
    """The statuses of link, robot, commands and sensors of an open robot.

    Args:
        name: The node's.
        driver_type: The driver's name.
        view: Of the robot.
        link_values: The node's own counters for the status of the link.
        ignored_types: Message types that others publish on cmd_vel but the node does not hear.
        channels: The robot's sensors.
    """
    connection = view.connection
    identity = identity_of(connection.robot)
    # The silence first: it may be the reason why a session cannot be prepared.
    problem = view.silence or connection.problem
    link = (OK, "connected") if problem is None else (ERROR, str(problem))
    values = {"driver": driver_type, **identity, **asdict(connection.robot.statistics)}
    if view.sample is not None:
        values["sample_time_error_s"] = view.sample.stamp_error_s
    parts = {
        "link": (*link, values | link_values),
        "robot": _robot(view),
        "commands": _commands(connection, ignored_types),
        **{f"sensor {status.info.name}": channel_words(status) for status in channels},
    }
    return [
        status_of(f"{name}: {part}", level, message, identity.get("board_id", ""), values)
        for part, (level, message, values) in parts.items()
    ]


def identity_of(robot: BaseDriver) -> dict[str, str]:
    """What the driver knows about its device; empty for a driver without one."""
    if not robot.has_device:
        return {}
    info = robot.info
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


def warnings_of(robot: BaseDriver) -> tuple[str, ...]:
    """What keeps the device from driving or makes it less safe, by its board."""
    try:
        return robot.warnings
    except WheelwireError:  # out of reach, which is another status, or without a device
        return ()


Part = tuple[bytes, str, dict[str, Any]]
"""Level, message and values of a status."""


def _robot(view: View) -> Part:
    connection, sample, silence = view[:3]
    if sample is None:
        return WARN, "no sample yet", {}
    state = of_robot(view)
    values = {
        "state": state.state,
        "faults": state.fault_names,
        "stop": state.stop,
        "held_by": "" if state.held_by is None else " ".join(state.held_by.names),
        "last_stop": str(connection.robot.last_stop or ""),
        "control_overruns": sample.overruns,
        "command_seq": sample.command_seq,
        "boot_id": f"{sample.boot_id:08x}",
        "resets_unacknowledged": state.resets,
        **_counters(connection.robot),
    }
    if sample.battery_v is not None:
        values["battery_v"] = sample.battery_v
    warnings = _warnings(connection.robot, state)
    # Before the silence: this node's e-stop acts even if the robot is not heard.
    if connection.estopped or state.state == "ESTOPPED":
        level, message = ERROR, state.stop or "the e-stop is set"
    elif silence is not None:
        level, message = STALE, "the last known state; the robot is silent"
    elif state.faults:
        level, message = ERROR, state.stop or " ".join(fault.doc for fault in state.faults)
        port = identity_of(connection.robot).get("port", "ROBOT")
        if cure := cure_of_stores(sample.faults, port):
            message = f"{message} End this node, then run {cure}."
    elif warnings:
        level, message = WARN, " ".join(warnings)
    else:
        level, message = OK if state.state in NORMAL_STATES else WARN, sample.state.doc
    return level, message, values


def _warnings(robot: BaseDriver, state: RobotState) -> list[str]:
    warnings = list(state.held or warnings_of(robot))
    rolling_mps = robot.rolling_mps
    if rolling_mps is not None:
        text = f"The robot rolls at {rolling_mps:.2f} m/s although nothing drives it."
        warnings.insert(0, text)
    if state.reset:
        warnings.append(f"{state.reset[0].upper()}{state.reset[1:]}.")
    return warnings


def _counters(robot: BaseDriver) -> dict[str, Any]:
    """What control loop, encoders and the chip's memory report, as far as known."""
    values: dict[str, Any] = {}
    # Each call asks the robot without waiting, so this is the answer to the last report's call.
    counters, memory = robot.latest_control_counters(), robot.latest_memory()
    if counters is not None:
        values |= {
            "late_steps": counters.late_steps,
            "latest_step_us": counters.latest_step_us,
            "saturated_steps": counters.saturated_steps,
            "left_illegal_transitions": counters.left_illegal,
            "right_illegal_transitions": counters.right_illegal,
        }
    if memory is not None:
        stacks = (memory.control_stack, memory.housekeeping_stack, memory.sensors_stack)
        values |= {
            "free_heap_bytes": memory.free_heap,
            "least_free_heap_bytes": memory.least_free_heap,
            "least_free_stack_bytes": min(filter(None, stacks), default=0),
        }
    return values


def _commands(connection: RobotConnection, ignored_types: list[str]) -> Part:
    obeyed, ignored = connection.obeyed, sum(connection.ignored.values())
    values = {"obeyed": obeyed, "ignored": ignored}
    # Sorted by text, since the members of an Enum have no order.
    for reason, count in sorted(connection.ignored.items(), key=str):
        values[f"ignored_{reason.name.lower()}"] = count
    if not ignored_types:
        if connection.is_held:
            return WARN, connection.held_text, values
        return OK, f"{obeyed} obeyed, {ignored} ignored", values
    message = (
        f"the node ignores commands of type {', '.join(ignored_types)}: "
        "have all publishers publish one type, or set cmd_vel_type"
    )
    return WARN, message, values
