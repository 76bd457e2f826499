"""The lifecycle node of a robot, independent of the driver."""

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
from .library_log import forward_library_log
from .lifecycle import Autostart, refuse_impossible_transitions, steady_clock
from .open_robot import OpenRobot
from .parameter_bridge import ParameterBridge
from .parameters import Setting

DIAGNOSTICS_PERIOD_S = 1.0
NOT_CONFIGURED = "not configured"

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class BaseRobotNode(LifecycleNode):  # type: ignore[misc] # rclpy has no types
    """Obeys velocity commands and publishes the robot's motion.

    When configured, it has the robot open and measures; when active, it obeys cmd_vel and
    publishes. One thread runs all callbacks, another one reads the samples. No command is ever
    repeated or extended: each expires after its own time to live, on the robot's clock.

    Args:
        name: Name of the node.
        settings: Parameters of the class, in addition to those of every robot.

    Raises:
        rclpy.exceptions.ParameterException: A parameter has an invalid value.
    """

    def __init__(self, name: str, settings: Iterable[Setting] = ()) -> None:
        super().__init__(name)
        forward_library_log(self.get_logger())
        self._bridge = ParameterBridge(self, settings, self._use_settings)
        self._open: OpenRobot | None = None
        self._closed_because = NOT_CONFIGURED
        self._estopped = False
        """Whether the e-stop was set when the robot was closed; opening it sets it again."""
        self._failure: Exception | None = None
        self._failed = self.create_guard_condition(self._raise_failure)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(DIAGNOSTICS_PERIOD_S, self.report, clock=steady_clock())
        refuse_impossible_transitions(self)
        self._autostart = Autostart(self) if self.setting("autostart") else None

    @abstractmethod
    def open_driver(self) -> BaseDriver:
        """Open the driver; raises `WheelwireError`."""

    @property
    @abstractmethod
    def driver_type(self) -> str:
        """The driver's name, for /diagnostics."""

    def setting(self, name: str) -> Any:
        """The value of a parameter."""
        return self.get_parameter(name).value

    @property
    def given_parameters(self) -> dict[str, float]:
        """The robot's parameters that the user gave, by name."""
        return dict(self._bridge.given)

    def close(self) -> None:
        """Stop the wheels, then release everything. Safe to call more than once."""
        open_robot, self._open = self._open, None
        self._bridge.connection = None
        if open_robot is not None:
            self._estopped = open_robot.connection.estopped
            open_robot.close()

    def report(self) -> None:
        """Publish /diagnostics; called every second, and at once when something changes."""
        message = DiagnosticArray(status=self._statuses())
        message.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(message)

    # --- lifecycle -----------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the robot; fails if it cannot be reached or refuses a parameter."""
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
            self.get_logger().error(traceback.format_exc())  # rclpy would not log it
            raise
        self._bridge.connection = self._open.connection
        self._closed_because = NOT_CONFIGURED
        self._end_autostart()
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start obeying commands."""
        result = super().on_activate(state)
        if self._open is not None:
            self._open.connection.active = True
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the wheels and ignore commands."""
        if self._open is not None:
            self._open.connection.active = False
            try:
                self._open.connection.robot.stop()
            except WheelwireError as error:
                self.get_logger().warning(f"{error}; the last command ends at its deadline")
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the wheels and close the robot."""
        self.close()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """As `on_cleanup`, permanently."""
        self._end_autostart()
        self.close()
        return super().on_shutdown(state)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop the wheels after a failed transition; the node can be configured again."""
        self.close()
        self.get_logger().error(
            f"the transition from {state.label} failed: the node must be configured again"
        )
        return SUCCESS

    def _end_autostart(self) -> None:
        if self._autostart is not None:
            self._autostart.end()

    # --- what the parts report -----------------------------------------------------------------

    def _use_settings(self) -> None:
        if self._open is not None:
            with suppress(WheelwireError):  # not reachable: set in the next session
                self._open.use_settings()

    def _fail(self, error: Exception) -> None:
        """Called in the reader's thread: make the node's own thread raise the error and end."""
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
