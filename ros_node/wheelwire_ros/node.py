"""The lifecycle node of a robot, independent of the driver, and its automatic start."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.srv import ChangeState
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from wheelwire import (
    BaseDriver,
    DeviceSilent,
    LinkLost,
    PortUnavailable,
    RequestTimeout,
    WheelwireError,
    WrongBoard,
)
from wheelwire.errors import BoardMismatch

from . import diagnostics
from .drivers import Drivers
from .library_log import forward_library_log
from .motion_estimator import PoseRecord
from .open_robot import OpenRobot
from .parameter_bridge import ParameterBridge
from .parameters import is_set
from .robot_state import NOT_CONFIGURED, RobotState, StateReporter
from .services import STOPPED_BY_DEADLINE, create_services
from .threads import NodeThreads, steady_clock

DIAGNOSTICS_PERIOD_S = 1.0
AUTOSTART_PERIOD_S = 1.0
OUT_OF_REACH = (DeviceSilent, LinkLost, PortUnavailable, RequestTimeout)
"""Errors that may be over a second later, without anybody's help."""
FINALIZED = "finalized: restart the process"
FINALIZED_S = 1.0
"""From its finalization to the end of the process: the answer and the last state go out."""
ESTOP_WAITS = "the robot gets the e-stop before anything else, as soon as it can be reached"

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class Finalized(Exception):  # noqa: N818 - it says what happened to the node
    """The node is finalized, which no transition ends. `spin` raises it."""


class HardwareRobot(LifecycleNode):  # type: ignore[misc] # rclpy has no types
    """Obeys velocity commands and publishes the robot's motion.

    A configured node has the robot open and measures; an active one obeys cmd_vel and publishes.
    `threads.py` lists what runs in which thread. The node never repeats or extends a command: each
    expires after its own time to live, on the robot's clock.

    Args:
        problem: Why the node cannot read its parameter files, which keeps it unconfigured; empty if
            it can.
    """

    def __init__(self, problem: str = "") -> None:
        super().__init__("hardware_robot")
        forward_library_log(self.get_logger())
        # Before the other parts, which read the parameters that it declares.
        self.bridge = ParameterBridge(self, self._use_settings, problem)
        self._drivers = Drivers(self.setting, self.bridge.given, self.get_logger())
        self.threads = threads = NodeThreads(self)
        self.poses: dict[str, PoseRecord] = {}
        """The last pose of each board."""
        self._open: OpenRobot | None = None
        self._closed_because = NOT_CONFIGURED
        self._is_finalized = False
        self._is_starting = False
        """Whether the worker starts the node, or will."""
        self._tries_once = False
        """Whether the running transition is of that start, which comes again."""
        self._ending = threading.Event()
        self._twins = diagnostics.TwinWatch()
        self._estopped = False
        """Whether the e-stop was set while, or before, no robot was open; opening sets it again."""
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._state = StateReporter(
            self, self._present_state, lambda: threads.general.create_task(self.report)
        )
        create_services(self, threads)
        defer_transitions(self, threads)
        self.bridge.defer_requests(threads)
        # By the node's own clock it would wait for /clock when use_sim_time is set.
        self.create_timer(DIAGNOSTICS_PERIOD_S, self.report, clock=steady_clock())
        self._autostart = self.create_timer(
            AUTOSTART_PERIOD_S, self._start_soon, clock=steady_clock()
        )
        """Until anything configures the node or shuts it down: then only users change its state."""
        if self.setting("autostart"):
            threads.general.create_task(self._start_soon)  # at once, not after the first period
        else:
            self._autostart.cancel()
        self.update_state()

    def open_driver(self) -> BaseDriver:
        """Open the driver; raises `WheelwireError`."""
        return self._drivers.open()

    def setting(self, name: str) -> Any:
        """The value of a parameter; None for one of the robot's whose value is still unknown."""
        return self.get_parameter_or(name).value

    def list_parameters(self, prefixes: list[str], depth: int) -> Any:
        """Leave out parameters without a value.

        Otherwise a client that reads the whole list, as `ros2 param dump` does, gets nothing.
        """
        result = super().list_parameters(prefixes, depth)
        result.names = [name for name in result.names if is_set(self, name)]
        return result

    def spin(self) -> None:
        """Run until the context is shut down; raises what a callback or a thread raises."""
        self.threads.spin()

    def close(self) -> None:
        """Stop the wheels, then release everything, for good. Safe to call more than once."""
        self._ending.set()
        # Before the threads, which may take seconds to end.
        self._close_robot()
        self.threads.close()
        self._close_robot()  # a running transition may have opened it

    def open_robot(self) -> OpenRobot:
        """The robot while it is open; else raises `LinkLost` with the reason."""
        open_robot = self._open  # another thread may close it
        if open_robot is None:
            raise LinkLost(f"the robot is not open: {self._closed_because}")
        return open_robot

    @property
    def _closed_reason(self) -> str:
        """Why the robot is not open, and what waits for it."""
        waits = f"; {ESTOP_WAITS}" if self._estopped and not self._is_finalized else ""
        return f"{self._closed_because}{waits}"

    def set_estop(self) -> None:
        """Set the e-stop of the robot, or of the next one that the node opens.

        Raises:
            WheelwireError: The robot cannot be reached; the node stops it as soon as it can be.
        """
        if self._is_finalized:
            raise WheelwireError(f"there is no robot: {FINALIZED}")
        self._estopped = True  # first: the robot may be about to be opened
        try:
            self.open_robot().connection.estop()
        except WheelwireError as error:
            raise WheelwireError(
                f"the stop is not confirmed: {error}. {ESTOP_WAITS[0].upper()}{ESTOP_WAITS[1:]}; "
                "a lost robot's wheels stop when their last command expires"
            ) from error

    def clear_estop(self) -> str:
        """Clear the e-stop; returns what was cleared.

        Raises:
            WheelwireError: Its cause is present, or the robot cannot be reached.
        """
        open_robot = self._open
        if open_robot is None:
            self._estopped = False
            return (
                "no robot is open: this node will set no e-stop on it, but an e-stop that the "
                "robot itself has latched stays set"
            )
        try:
            open_robot.connection.clear_estop()
        except LinkLost as error:
            raise LinkLost(f"nothing was cleared, the e-stop stays set: {error}") from error
        self._estopped = open_robot.connection.estopped  # somebody may have set it again
        return "the e-stop is cleared"

    def report(self) -> None:
        """Publish /diagnostics; called every second, and at once when something changes."""
        open_robot = self._open
        if open_robot is not None:
            # Once a second another attempt, if the last one to prepare the session failed.
            open_robot.prepare_soon()
        own = (self.get_name(), self.get_namespace())
        nodes_of_this_name = self.get_node_names_and_namespaces().count(own)
        if self._twins.look(nodes_of_this_name, time.monotonic()):
            self.get_logger().error(diagnostics.TWIN)
        name = self.get_fully_qualified_name().lstrip("/")
        if open_robot is None:
            reason = self._closed_reason
            statuses = diagnostics.closed_status(name, self.setting("driver_type"), reason)
        else:
            statuses = open_robot.statuses(name)
        if self._twins.has_twin:
            statuses.append(diagnostics.twin_status(name))
        message = DiagnosticArray(status=statuses)
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    def update_state(self) -> None:
        """Publish and log the robot's state if it has changed; from any thread."""
        self._state.update()

    # --- lifecycle -----------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the robot, as soon as it can be reached; fails if it refuses a parameter."""
        try:
            while not self._is_opened():
                if self._tries_once or self._ending.wait(AUTOSTART_PERIOD_S):
                    return FAILURE  # it stays unconfigured: the next start tries again
                self.update_state()
        except WheelwireError as error:
            self._closed_because = str(error)
            return FAILURE  # what is refused has to be corrected first
        except Exception:
            if self.context.ok():  # otherwise the node is ending, and every step fails
                self.get_logger().error(traceback.format_exc())  # rclpy would not log it
            raise
        robot = self.open_robot()
        if self._estopped and not robot.connection.estopped:  # set during the opening
            with suppress(WheelwireError):  # preparing the session sends it again
                robot.connection.estop()
        self.bridge.connection = robot.connection
        self._closed_because = NOT_CONFIGURED
        self._autostart.cancel()
        return super().on_configure(state)

    def _is_opened(self) -> bool:
        """Open the robot; false if that may work at another time.

        Raises:
            WheelwireError: A parameter, or the board, is refused.
        """
        try:
            self.bridge.require_accepted()
            self._open = OpenRobot(self, self.open_driver(), estopped=self._estopped)
        except OUT_OF_REACH as error:
            is_refused = isinstance(error, (WrongBoard, BoardMismatch))
            if is_refused or getattr(error, "is_other_board", False):
                raise  # it was reached
            self._closed_because = str(error)
            return False
        return True

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start obeying commands."""
        result = super().on_activate(state)
        if self._open is not None:
            # After the publishers were enabled: a disabled one drops its messages.
            self._open.activate()
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the wheels and ignore commands."""
        if self._open is not None:
            # First, so that no command follows the stop: this waits for one that is being sent.
            self._open.connection.deactivate()
            try:
                self._open.connection.stop()
            except WheelwireError as error:
                self.get_logger().warning(f"{error}; {STOPPED_BY_DEADLINE}")
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the wheels and close the robot."""
        self._close_robot()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As `on_cleanup`, permanently: the process ends a moment later."""
        self._autostart.cancel()
        self._close_robot()
        self._is_finalized, self._closed_because = True, FINALIZED
        # Nothing leads out of this state: the process has to be restarted.
        end = threading.Timer(FINALIZED_S, self.threads.fail, [Finalized(FINALIZED)])
        end.daemon = True
        end.start()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the wheels after a failed transition; the node can be configured again."""
        self._close_robot()
        self.get_logger().error(
            f"the transition from {state.label} failed: configure the node again"
        )
        # Leads to unconfigured; anything else would finalise the node for good.
        return SUCCESS

    def _close_robot(self) -> None:
        # Removed before it is closed: other threads then find no robot, not a closing one.
        open_robot, self._open = self._open, None
        self.bridge.connection = None
        if open_robot is not None:
            self._estopped = self._estopped or open_robot.connection.estopped
            open_robot.close()

    def _start_soon(self) -> None:
        # An attempt on a silent robot takes longer than a period: attempts must not queue up.
        if self._autostart.is_canceled() or self._is_starting:
            return
        self._is_starting = True
        with suppress(RuntimeError):  # the worker is shut down
            self.threads.transitions.submit(self._start)

    def _start(self) -> None:
        """Configure and activate the node, if it can be reached at once."""
        try:
            if self._autostart.is_canceled():  # during the call
                return
            self._tries_once = True
            if self.trigger_configure() == SUCCESS:
                self.trigger_activate()
            self.update_state()
        except Exception as error:
            self.threads.fail(error)
        finally:
            self._is_starting = self._tries_once = False

    # --- what the parts ask for ----------------------------------------------------------------

    def _use_settings(self) -> None:
        open_robot = self._open
        if open_robot is not None:
            with suppress(WheelwireError):  # out of reach: the next session gets the settings
                open_robot.use_settings()

    def _present_state(self) -> RobotState:
        open_robot = self._open
        if open_robot is None:
            return RobotState("closed", self._closed_reason)
        return open_robot.state()


def defer_transitions(node: Any, threads: NodeThreads) -> None:
    """Have a worker serve transitions, and refuse any that the current state does not have.

    rclpy lets the error of such a transition escape from the service's callback, which ends the
    node; a lifecycle manager that configures a self-started node would cause that.
    """
    for service in node.services:
        if service.srv_type is ChangeState:
            # First this one: `defer` wraps the callback that it finds.
            service.callback = _refusing(node, service.callback)
            threads.defer(service, threads.transitions)


def _refusing(node: Any, change_state: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def serve(request: ChangeState.Request, response: ChangeState.Response) -> Any:
        try:
            return change_state(request, response)
        except RuntimeError as error:  # of the state machine; a transition handles its own errors
            node.get_logger().warning(str(error))
            response.success = False
            return response
        finally:
            node.update_state()

    return serve
