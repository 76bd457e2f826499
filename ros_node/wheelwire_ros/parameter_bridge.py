"""Keeps the parameters of the node and those of the robot consistent."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter

from wheelwire import BaseDriver, WheelwireError

from . import parameters
from .connection import RobotConnection
from .threads import NodeThreads


class ParameterBridge:
    """Passes changes of a node's parameters to its robot, and the robot's values to the node.

    Args:
        node: An rclpy node, on which the parameters are declared.
        own: Settings of its class, in addition to those of every node.
        on_change: Called after a change, except by `mirror`.

    Attributes:
        connection: The connection to the robot while it is open.
        given: The robot's parameters that the user gave, by name.
    """

    def __init__(
        self, node: Any, own: Iterable[parameters.Setting], on_change: Callable[[], None]
    ) -> None:
        self.connection: RobotConnection | None = None
        own = tuple(own)
        self.given = parameters.declare(node, own)
        self._fixed = {s.name for s in (*parameters.SETTINGS, *own) if not s.live}
        self._node = node
        self._on_change = on_change
        self._mirroring_thread: int | None = None
        """The thread in which `mirror` sets parameters; another one may set others meanwhile."""
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._use)

    def defer_requests(self, threads: NodeThreads) -> None:
        """Serve in a lane what asks the robot, so that other parameters are answered meanwhile."""
        for service in self._node.services:
            if service.srv_type in (SetParameters, SetParametersAtomically):
                threads.defer(service, threads.requests, self._asks_robot)

    def mirror(self, robot: BaseDriver) -> None:
        """Copy the robot's values to the node; raises `WheelwireError` if they cannot be read."""
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

    def _asks_robot(self, request: Any) -> bool:
        names = {parameter.name for parameter in request.parameters}
        return self.connection is not None and not names.isdisjoint(parameters.ROBOT_PARAMETERS)

    @property
    def _mirroring(self) -> bool:
        return self._mirroring_thread == threading.get_ident()

    def _check(self, changes: list[Parameter]) -> SetParametersResult:
        """Send the robot its parameters; refuse what it refuses, and what can no longer change."""
        if self._mirroring:
            return SetParametersResult(successful=True)
        of_robot = {
            change.name: float(change.value)
            for change in changes
            if change.name in parameters.ROBOT_PARAMETERS
        }
        if self.connection is not None:
            late = ", ".join(change.name for change in changes if change.name in self._fixed)
            if late:
                return _refusal(
                    f"{late}: read when the node is configured; clean up the node first"
                )
            try:
                self.connection.set_parameters(of_robot)
            except WheelwireError as error:
                return _refusal(str(error))
        self.given.update(of_robot)
        return SetParametersResult(successful=True)

    def _use(self, _changes: list[Parameter]) -> None:
        if not self._mirroring:
            self._on_change()


def _refusal(reason: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=reason)
