"""`~/state`: what the robot does and why it does not drive, published and logged at each change."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from wheelwire import Fault, SupervisorState, WheelSample, WheelwireError

from .qos import LATCHED

NOT_CONFIGURED = "not configured"
PREPARING = "a new session is being prepared"
ESTOP_BY_NODE = "the e-stop was set by ~/estop of this node"
ESTOP_BY_OTHERS = "the e-stop was set by its contact or by another program"

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class RobotState(NamedTuple):
    """What is told at each change. Empty texts are unknown."""

    link: str
    """`closed`: the node is not configured; `lost`, `preparing` or `connected`."""
    cause: str
    """Why it cannot be driven; empty if it can."""
    state: str = ""
    """The supervisor's, by name."""
    faults: tuple[Fault, ...] = ()
    boot_id: int | None = None
    session: int = 0
    reset: str = ""
    """That the device was reset or replaced, until somebody acknowledges it."""
    reset_reason: str = ""
    """Why it last started, by name, as long."""
    resets: int = 0
    """How often, as long."""

    @property
    def level(self) -> Any:
        """As in /diagnostics."""
        if self.link in ("closed", "lost") or self.faults or self.state == "ESTOPPED":
            return ERROR
        return WARN if self.cause or self.reset else OK

    @property
    def words(self) -> str:
        """One sentence for a person."""
        if self.cause or self.reset:
            return "; ".join(filter(None, (self.cause, self.reset)))
        return SupervisorState[self.state].doc if self.state else "connected"

    def message(self, name: str, hardware_id: str) -> DiagnosticStatus:
        """The message on `~/state`."""
        values = {
            "state": self.state,
            "faults": " ".join(str(fault.name) for fault in self.faults),
            "cause": self.cause,
            "link": self.link,
            "boot_id": "" if self.boot_id is None else f"{self.boot_id:08x}",
            "session": str(self.session),
            "resets": str(self.resets),
            "reset_reason": self.reset_reason,
        }
        return DiagnosticStatus(
            level=self.level,
            name=name,
            message=self.words,
            hardware_id=hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )


def closed(reason: str) -> RobotState:
    """The state while the robot is not open."""
    return RobotState("closed", reason)


def of_robot(
    sample: WheelSample | None,
    silence: WheelwireError | None,
    problem: WheelwireError | None,
    session: int,
    *,
    prepared: bool,
    estopped: bool,
) -> RobotState:
    """The state of an open robot.

    Args:
        sample: The newest one, if there is one.
        silence: Why no sample has come recently; None if one has.
        problem: Why the session could not be prepared; None if it could.
        session: Its number.
        prepared: Whether it has been.
        estopped: Whether this node has set the e-stop.
    """
    # The first of these that applies hides the rest: what lies behind a lost link is not known.
    if silence is not None:
        link, cause = "lost", f"the robot cannot be reached: {silence}"
    elif problem is not None:
        link, cause = "preparing", f"the robot is not driven: {problem}"
    elif not prepared or sample is None:
        link, cause = "preparing", PREPARING
    else:
        link, cause = "connected", ""
    if sample is None:
        return RobotState(link, cause, session=session)
    faults = tuple(fault for fault in Fault if fault in sample.faults)
    if not cause and sample.state is SupervisorState.ESTOPPED:
        cause = ESTOP_BY_NODE if estopped else ESTOP_BY_OTHERS
    elif not cause:
        cause = " ".join(f"{fault.name}: {fault.doc}" for fault in faults)
    return RobotState(link, cause, sample.state.name, faults, sample.boot_id, session)


class StateReporter:
    """Publishes and logs the robot's state when it has changed. For any thread.

    Args:
        node: An rclpy node.
        state: Finds out the present state.
        hardware_id: The robot's board.
        on_change: Called after each change.
    """

    def __init__(
        self,
        node: Any,
        state: Callable[[], RobotState],
        hardware_id: Callable[[], str],
        on_change: Callable[[], None],
    ) -> None:
        self._node = node
        self._state = state
        self._hardware_id = hardware_id
        self._on_change = on_change
        self._publisher = node.create_publisher(DiagnosticStatus, "~/state", LATCHED)
        self._told: RobotState | None = None
        self._lock = threading.Lock()

    def update(self) -> None:
        """Publish and log the state, unless it is the one that was told last."""
        if not self._node.context.ok():  # the node is ending, and nobody can be told
            return
        with self._lock:  # the newest state is told last
            state, before = self._state(), self._told
            if state == before:
                return
            self._told = state
            name = self._node.get_fully_qualified_name().lstrip("/")
            self._publisher.publish(state.message(name, self._hardware_id()))
            self._log(state, before)
        self._on_change()

    def _log(self, state: RobotState, before: RobotState | None) -> None:
        """One line for what a person should know; driving and standing still is not told."""
        logger = self._node.get_logger()
        if state.cause == PREPARING or (before is None and state.cause == NOT_CONFIGURED):
            # Every start and every reconnection begins like this: only what follows is told.
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
