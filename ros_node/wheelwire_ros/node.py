"""The lifecycle node of a robot, whatever drives it."""

from __future__ import annotations

import traceback
from abc import abstractmethod
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from wheelwire import BaseDriver, WheelwireError

from . import diagnostics
from .lifecycle import Autostart, refuse_impossible_transitions, steady_clock
from .open_robot import OpenRobot
from .parameter_bridge import ParameterBridge
from .parameters import Setting

DIAGNOSTICS_PERIOD_S = 1.0
NOT_CONFIGURED = "not configured"

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class BaseRobotNode(LifecycleNode):  # type: ignore[misc] # rclpy has no types
    """Commands in, motion out.

    Configured, it has the robot open and measures; active, it obeys cmd_vel and publishes. One
    thread runs every callback, another one takes the samples. Nothing here repeats a command: each
    acts until its own time to live is over, on the robot's clock, and no timer extends it.

    Args:
        name: Of the node.
        settings: Parameters of the class, beyond those of every robot.

    Raises:
        rclpy.exceptions.ParameterException: A parameter has a value that it cannot have.
    """

    def __init__(self, name: str, settings: Iterable[Setting] = ()) -> None:
        super().__init__(name)
        self._bridge = ParameterBridge(self, settings, self._use_settings)
        self._open: OpenRobot | None = None
        self._closed_because = NOT_CONFIGURED
        self._estopped = False
        """When the robot was closed: it is opened so again."""
        self._failure: Exception | None = None
        self._failed = self.create_guard_condition(self._raise_failure)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(DIAGNOSTICS_PERIOD_S, self.report, clock=steady_clock())
        refuse_impossible_transitions(self)
        self._autostart = Autostart(self) if self.setting("autostart") else None

    @abstractmethod
    def open_driver(self) -> BaseDriver:
        """Reach the robot; raises `WheelwireError`."""

    @property
    @abstractmethod
    def driver_type(self) -> str:
        """What reaches the robot, for /diagnostics."""

    def setting(self, name: str) -> Any:
        """A parameter's value."""
        return self.get_parameter(name).value

    @property
    def given_parameters(self) -> dict[str, float]:
        """Those of the robot's parameters that the user gave, by name."""
        return dict(self._bridge.given)

    def close(self) -> None:
        """Stop the wheels, then give everything back. Harmless when repeated."""
        open_robot, self._open = self._open, None
        self._bridge.connection = None
        if open_robot is not None:
            self._estopped = open_robot.connection.estopped
            open_robot.close()

    def report(self) -> None:
        """Say in /diagnostics how things are; done each second, and at once when they change."""
        message = DiagnosticArray(status=self._statuses())
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    # --- lifecycle -----------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the robot; fails while it is out of reach or does not take its parameters."""
        try:
            self._open = OpenRobot(
                self, self.open_driver(), self._bridge, self._fail, estopped=self._estopped
            )
        except WheelwireError as error:
            if str(error) != self._closed_because:
                self.get_logger().error(f"cannot configure: {error}")
            self._closed_because = str(error)
            return FAILURE
        except Exception:
            self.get_logger().error(traceback.format_exc())  # rclpy would keep it to itself
            raise
        self._bridge.connection = self._open.connection
        self._closed_because = NOT_CONFIGURED
        self._end_autostart()
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Obey commands from now on."""
        result = super().on_activate(state)
        if self._open is not None:
            self._open.connection.active = True
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """The wheels stop first."""
        if self._open is not None:
            self._open.connection.active = False
            try:
                self._open.connection.robot.stop()
            except WheelwireError as error:
                self.get_logger().warning(f"{error}; the last command ends by its deadline")
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let go of the robot; its wheels stop first."""
        self.close()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As `on_cleanup`, for good."""
        self._end_autostart()
        self.close()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """A transition failed: the wheels stop, and the node can be configured again."""
        self.close()
        self.get_logger().error(f"the transition from {state.label} failed: not configured")
        return SUCCESS

    def _end_autostart(self) -> None:
        if self._autostart is not None:
            self._autostart.end()

    # --- what the parts report -----------------------------------------------------------------

    def _use_settings(self) -> None:
        if self._open is not None:
            with suppress(WheelwireError):  # out of reach: the next session takes them
                self._open.use_settings()

    def _fail(self, error: Exception) -> None:
        """In the reader's thread: the node's own thread tells what it was, and ends."""
        self._failure = error
        self._failed.trigger()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _statuses(self) -> list[Any]:
        name = self.get_fully_qualified_name().lstrip("/")
        if self._open is None:
            return diagnostics.closed_status(name, self.driver_type, self._closed_because)
        self._open.follow()
        return self._open.statuses(name, self.driver_type)
