"""`~/state`: what the robot does and why it does not drive, published and logged at each change."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.qos import DurabilityPolicy, QoSProfile

from wheelwire import (
    BaseDriver,
    EstopSource,
    Fault,
    Held,
    HeldBy,
    SupervisorState,
    WheelSample,
    WheelwireError,
)
from wheelwire.link.holds import UNARMED

from .robot_connection import RobotConnection
from .sensors import Limits

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A subscriber that comes later gets the last message, too."""
NOT_CONFIGURED = "not configured"
PREPARING = "a new session is being prepared"
ESTOP_BY_NODE = "the e-stop was set by ~/estop of this node"
ESTOP_BY_OTHERS = "the e-stop was set by its contact or by another program"
ESTOPS = {
    EstopSource.CONTACT: "the e-stop was set by its contact",
    EstopSource.OTHER_PROGRAM: "the e-stop was set by another program",
    EstopSource.BEFORE_POWER_ON: "the e-stop was set before the robot was powered on",
    EstopSource.DAMAGED_RECORD: "the record of latched e-stops is damaged: an e-stop",
}
ACKNOWLEDGED_BY = "~/clear_fault acknowledges it"

_NO_NEWS = Held.ESTOP | Held.CONTACT | Held.FAULT | UNARMED
"""What the state says, or the status of the commands."""

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class RobotState(NamedTuple):
    """What the node reports at each change. An empty text is unknown."""

    link: str
    """`closed`: the node is not configured; `lost`, `preparing` or `connected`."""
    cause: str
    """Why the robot cannot be driven; empty if it can."""
    state: str = ""
    """The supervisor's, by name."""
    faults: tuple[Fault, ...] = ()
    boot_id: int | None = None
    session: int = 0
    reset: str = ""
    """Text: the device was reset or replaced, until somebody acknowledges it."""
    reset_reason: str = ""
    """Why the device last started, by name, until then."""
    resets: int = 0
    """How often the device was reset, until then."""
    board_id: str = ""
    """Id of the device; empty where the driver does not report it."""
    stop: str = ""
    """Why the robot stopped, until it drives again."""
    limits: Limits = Limits()
    """What the sensors keep it from."""
    odom_held: bool = False
    """Whether odom goes on without samples, with the last pose."""
    held_by: HeldBy | None = None
    """What holds it, by its own report; None: not known."""
    last_stop: str = ""
    """What ended its last motion, with its code."""

    @property
    def held(self) -> tuple[str, ...]:
        """What holds it apart from a latch, in sentences; not that it must be armed."""
        if self.held_by is None:
            return ()
        return tuple(self.held_by.sentence(flag) for flag in self.held_by if flag not in _NO_NEWS)

    @property
    def level(self) -> Any:
        """As in /diagnostics."""
        if self.link in ("closed", "lost") or self.faults or self.state == "ESTOPPED":
            return ERROR
        return WARN if self.cause or self.reset or self.limits.sentences or self.held else OK

    @property
    def words(self) -> str:
        """One sentence for a person."""
        # With the sensors' samples their names are known, too.
        told = [*filter(None, (self.cause, self.reset)), *(self.limits.sentences or self.held)]
        if told:
            return "; ".join(told)
        return SupervisorState[self.state].doc if self.state else "connected"

    @property
    def fault_names(self) -> str:
        """The names of the latched faults."""
        return " ".join(str(fault.name) for fault in self.faults)

    def message(self, name: str) -> DiagnosticStatus:
        """The message on `~/state`."""
        values = {
            "state": self.state,
            "faults": self.fault_names,
            "cause": self.cause,
            "stop": self.stop,
            "held_by": "" if self.held_by is None else " ".join(self.held_by.names),
            "last_stop": self.last_stop,
            "triggered": " ".join(self.limits.triggered),
            "reflexes": " ".join(self.limits.reflexes),
            "sensors": "; ".join(self.limits.sentences),
            "link": self.link,
            "odom": "held" if self.odom_held else "measured",
            "boot_id": "" if self.boot_id is None else f"{self.boot_id:08x}",
            "session": self.session,
            "resets": self.resets,
            "reset_reason": self.reset_reason,
        }
        return status_of(name, self.level, self.words, self.board_id, values)


def status_of(
    name: str, level: bytes, message: str, hardware_id: str, values: dict[str, Any]
) -> DiagnosticStatus:
    """A message of these values; what is not known, NaN, is an empty text."""
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id=hardware_id,
        values=[KeyValue(key=key, value=_text(value)) for key, value in values.items()],
    )


def _text(value: object) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


class ResetWatch:
    """Remembers that the device was reset or replaced, until somebody acknowledges it.

    Otherwise a person who looks later would not notice a chip that crashed for less than a second.
    """

    def __init__(self) -> None:
        self.reason = ""
        """Why the device last started, by name; empty after no reset."""
        self.count = 0
        """Unacknowledged resets."""
        self.text = ""
        """One sentence for a person; empty after no reset."""
        self.board_id = ""
        """Id of the device that sent the last sample; empty where the driver does not report it."""
        self._boot_id: int | None = None

    def note(self, sample: WheelSample, robot: BaseDriver) -> bool:
        """Look at the next sample; whether it is the first after a reset."""
        if sample.boot_id == self._boot_id:
            return False
        is_first, self._boot_id = self._boot_id is None, sample.boot_id
        # Samples begin after the hello, so what the driver knows is of this boot.
        reason, doc, board_id = _last_start(robot)
        is_replaced, self.board_id = board_id != self.board_id, board_id
        if is_first:
            return False
        self.count += 1
        self.reason = reason
        if is_replaced:
            self.text = f"another device was connected: {board_id}; {ACKNOWLEDGED_BY}"
        else:
            times = f" ({self.count} times)" if self.count > 1 else ""
            self.text = f"the device was reset{times}: {reason}, {doc}; {ACKNOWLEDGED_BY}"
        return True

    def acknowledge(self) -> None:
        """Forget all resets so far."""
        self.count, self.reason, self.text = 0, "", ""


def _last_start(robot: BaseDriver) -> tuple[str, str, str]:
    """Why the device last started, by name and in words, and its board's identity."""
    if not robot.has_device:
        return "UNKNOWN", "the driver does not report why", ""
    device = robot.info.device
    doc = device.reset_reason.doc
    return device.reset_reason.name, doc[0].lower() + doc[1:].rstrip("."), device.board_id


class View(NamedTuple):
    """What the node sees of an open robot."""

    connection: RobotConnection
    sample: WheelSample | None
    """The newest one; None before the first."""
    silence: WheelwireError | None
    """Why no sample has come recently; None if one has."""
    resets: ResetWatch
    """The device's."""
    estopped: bool = False
    """Whether this node has set the e-stop."""
    stop: str = ""
    """Why it stopped; empty while it drives."""
    limits: Limits = Limits()
    """What the sensors keep it from."""
    odom_held: bool = False
    """Whether odom goes on without samples."""


def of_robot(view: View) -> RobotState:
    """The state of an open robot."""
    connection, sample, silence, resets = view[:4]
    robot = connection.robot
    held_by, last_stop = robot.held_by, robot.last_stop
    # The first of these that applies hides the rest: for example, a lost link shows nothing else.
    if silence is not None:
        link, cause = "lost", f"the robot cannot be reached: {silence}"
    elif connection.problem is not None:
        link, cause = "preparing", f"the robot is not driven: {connection.problem}"
    elif not connection.is_prepared or sample is None:
        link, cause = "preparing", PREPARING
    else:
        link, cause = "connected", ""
    state = RobotState(
        link,
        cause,
        session=robot.sessions,
        reset=resets.text,
        reset_reason=resets.reason,
        resets=resets.count,
        board_id=resets.board_id,
        stop=view.stop,
        limits=view.limits,
        odom_held=view.odom_held,
        held_by=held_by,
        last_stop="" if last_stop is None else f"{last_stop.cause.name}: {last_stop.cause.doc}",
    )
    if sample is None:
        return state
    faults = tuple(fault for fault in Fault if fault in sample.faults)
    if not cause and sample.state is SupervisorState.ESTOPPED:
        source = EstopSource.NONE if held_by is None else held_by.estop_source
        cause = ESTOP_BY_NODE if view.estopped else ESTOPS.get(source, ESTOP_BY_OTHERS)
    elif not cause:
        cause = " ".join(f"{fault.name}: {fault.doc}" for fault in faults)
    return state._replace(
        cause=cause, state=sample.state.name, faults=faults, boot_id=sample.boot_id
    )


@dataclass
class StateReporter:
    """Publishes and logs the robot's state when it has changed. For any thread.

    Args:
        node: An rclpy node.
        state: Returns the present state.
        on_change: Called after each change.
    """

    node: Any
    state: Callable[[], RobotState]
    on_change: Callable[[], None]

    def __post_init__(self) -> None:
        self._publisher = self.node.create_publisher(DiagnosticStatus, "~/state", LATCHED)
        self._reported: RobotState | None = None
        self._lock = threading.Lock()

    def update(self) -> None:
        """Publish and log the state, unless it is the one that was reported last."""
        if not self.node.context.ok():  # the node is ending, and cannot publish any more
            return
        with self._lock:  # so that the newest state is the last on the topic
            state, before = self.state(), self._reported
            if state == before:
                return
            self._reported = state
            name = self.node.get_fully_qualified_name().lstrip("/")
            self._publisher.publish(state.message(name))
            self._log(state, before)
        self.on_change()

    def _log(self, state: RobotState, before: RobotState | None) -> None:
        """Log one line that a person should know; not that the robot drives or stands still."""
        logger = self.node.get_logger()
        if state.cause == PREPARING or (before is None and state.cause == NOT_CONFIGURED):
            # Every start and every reconnection begins like this: the next change is worth a line.
            return
        cause = before.cause if before is not None else ""
        if state.cause == NOT_CONFIGURED:
            logger.info("the robot is closed")
        elif state.cause:
            if state.cause != cause:
                logger.error(state.cause)
        elif before is None or before.link != "connected" or before.boot_id != state.boot_id:
            boot = "" if state.boot_id is None else f", boot {state.boot_id:08x}"
            logger.info(f"the robot is connected: session {state.session}{boot}")
        elif cause:
            logger.info(f"the robot can be driven again; before: {cause}")
