"""Keeps the node's and the robot's parameters consistent."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter

from wheelwire import BaseDriver, ConfigurationError, WheelwireError

from . import parameters
from .parameter_values import Disagreement, disagreements, same, start_values
from .robot_connection import RobotConnection
from .threads import NodeThreads


class ParameterBridge:
    """Passes changes of a node's parameters to its robot, and the robot's values to the node.

    After a refused value at the start the parameter has its default; the node says so and stays
    unconfigured until somebody sets the parameter. If it ended, launch would restart it for ever.

    Args:
        node: An rclpy node; its parameters are declared here.
        on_change: Called after a change, except by `mirror`.
        problem: Why the parameter files cannot be read; empty if they can.

    Attributes:
        connection: The connection to the robot while it is open.
        given: The robot's parameters that the user gave, by name.
    """

    def __init__(self, node: Any, on_change: Callable[[], None], problem: str = "") -> None:
        self.connection: RobotConnection | None = None
        self.given: dict[str, float] = {}
        self._settings = {s.name: s for s in parameters.SETTINGS}
        self._node = node
        self._on_change = on_change
        self._mirroring_thread: int | None = None
        """The thread in which `mirror` sets parameters; another thread may set others at the same
        time."""
        self._refused: dict[str, str] = {"parameter file": problem} if problem else {}
        parameters.declare(node)
        # Before the callbacks are added: values that agree only together are set one by one.
        self._start()
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._use)

    def defer_requests(self, threads: NodeThreads) -> None:
        """Have a worker serve requests that ask the robot, so that they delay no others."""
        for service in self._node.services:
            if service.srv_type in (SetParameters, SetParametersAtomically):
                threads.defer(service, threads.requests, self._asks_robot)

    def require_accepted(self) -> None:
        """Raise `ConfigurationError` while a parameter's value is refused."""
        refused = _reasons(disagreements(self._value_of)) | self._refused
        if refused:
            reasons = "; ".join(f"{name}: {reason}" for name, reason in refused.items())
            raise ConfigurationError(
                f"refused parameters: {reasons}. Correct them in the file and start again, or set "
                "them now (ros2 param set)"
            )

    def mirror(self, robot: BaseDriver) -> None:
        """Copy the robot's values to the node.

        Raises:
            ConfigurationError: They contradict the node's.
            WheelwireError: They cannot be read.
        """
        values = [
            parameters.from_robot(info.name, info.value)
            for info in robot.parameters.list()
            if info.name in parameters.ROBOT_PARAMETERS
        ]
        # Setting them calls `_check`, which must not send the robot its own values.
        self._mirroring_thread = threading.get_ident()
        try:
            self._node.set_parameters(values)
        finally:
            self._mirroring_thread = None
        on_robot = {value.name: value.value for value in values}
        reasons = _reasons(disagreements(lambda name: on_robot.get(name, self._value_of(name))))
        if reasons:
            text = "; ".join(f"{names}: {reason}" for names, reason in reasons.items())
            raise ConfigurationError(f"{text} (ros2 param set)")

    def _asks_robot(self, request: Any) -> bool:
        names = {parameter.name for parameter in request.parameters}
        return self.connection is not None and not names.isdisjoint(parameters.ROBOT_PARAMETERS)

    @property
    def _mirroring(self) -> bool:
        return self._mirroring_thread == threading.get_ident()

    def _start(self) -> None:
        """Set what the user gave, except what is refused."""
        names = self._settings.keys() | parameters.ROBOT_PARAMETERS.keys()
        values, conflicts = start_values(self._node, names)
        for parameter in values.values():
            reason = conflicts.get(parameter.name) or self._wrong(parameter)
            if reason is None:
                (result,) = self._node.set_parameters([parameter])
                reason = None if result.successful else result.reason
            if reason is None:
                self.given.update(_of_robot([parameter]))
            else:
                self._refused[parameter.name] = reason

    def _check(self, changes: list[Parameter]) -> SetParametersResult:
        """Send the robot its parameters; refuse what it refuses, and what can no longer change."""
        reason = None if self._mirroring else self._refusal_of(changes)
        return SetParametersResult(successful=reason is None, reason=reason or "")

    def _refusal_of(self, changes: list[Parameter]) -> str | None:
        for change in changes:
            wrong = self._wrong(change)
            if wrong is not None:
                return f"{change.name}: {wrong}"
        new = {change.name: change.value for change in changes}
        for found in disagreements(lambda name: new.get(name, self._value_of(name))):
            # One between other parameters must not keep these from being set.
            if not new.keys().isdisjoint(found.names):
                return f"{', '.join(found.names)}: {found.reason}"
        of_robot = _of_robot(changes)
        if self.connection is not None:
            late = ", ".join(name for name, value in new.items() if self._is_late(name, value))
            if late:
                return f"{late}: read when the node is configured; clean up the node first"
            try:
                self.connection.set_parameters(of_robot)
            except WheelwireError as error:
                return str(error)
        # Without a robot, too: the next one gets them when it is opened.
        self.given.update(of_robot)
        return None

    def _wrong(self, parameter: Parameter) -> str | None:
        """Why a value of the right type is refused, apart from its range."""
        setting = self._settings.get(parameter.name)
        if setting is None or setting.check is None or parameter.type_ != setting.type_:
            return None  # nothing to check, the robot's parameter, or a type that rclpy refuses
        return setting.check(parameter.value)

    def _is_late(self, name: str, value: Any) -> bool:
        setting = self._settings.get(name)
        # The present value is never too late: somebody may load a whole file again.
        return setting is not None and not setting.live and not same(value, self._value_of(name))

    def _value_of(self, name: str) -> Any:
        if name in parameters.ROBOT_PARAMETERS and self.connection is None:
            # The node still shows the value of the robot that was open last; the next one may have
            # another.
            return self.given.get(name)
        return self._node.get_parameter_or(name).value  # None for a driver without parameters

    def _use(self, changes: list[Parameter]) -> None:
        if self._mirroring:
            return
        # Each of them was accepted, which corrects a value that was refused at the start.
        for change in changes:
            self._refused.pop(change.name, None)
        self._on_change()


def _reasons(found: Iterable[Disagreement]) -> dict[str, str]:
    return {", ".join(one.names): one.reason for one in found}


def _of_robot(changes: Iterable[Parameter]) -> dict[str, float]:
    return {
        change.name: float(change.value)
        for change in changes
        if change.name in parameters.ROBOT_PARAMETERS
    }
