"""Parameters of the node on one side, of the robot on the other: changes, refusals, readings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from wheelwire import BaseDriver, WheelwireError

from . import parameters
from .connection import RobotConnection


class ParameterBridge:
    """Keeps the parameters of a node and of its robot in step.

    Args:
        node: An rclpy node; the parameters are declared on it.
        own: The settings of its class, beyond those of every node.
        on_change: Called after a change, but for one by `mirror`.

    Attributes:
        connection: To the robot, while it is open.
        given: What the user gave of the robot's parameters, by name.
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
        self._mirroring = False
        node.add_on_set_parameters_callback(self._judge)
        node.add_post_set_parameters_callback(self._use)

    def mirror(self, robot: BaseDriver) -> None:
        """Show the robot's values; raises `WheelwireError` when it cannot be asked."""
        values = [
            parameters.from_robot(info.name, info.value)
            for info in robot.parameters.list()
            if info.name in parameters.ROBOT_PARAMETERS
        ]
        self._mirroring = True
        try:
            self._node.set_parameters(values)
        finally:
            self._mirroring = False

    def _judge(self, changes: list[Parameter]) -> SetParametersResult:
        """Hand the robot's own over to it; refuse what it refuses, and what comes too late."""
        if self._mirroring:
            return SetParametersResult(successful=True)
        robots = {
            change.name: float(change.value)
            for change in changes
            if change.name in parameters.ROBOT_PARAMETERS
        }
        if self.connection is not None:
            late = ", ".join(change.name for change in changes if change.name in self._fixed)
            if late:
                return _refusal(f"{late}: read when the node is configured; clean it up first")
            try:
                self.connection.set_parameters(robots)
            except WheelwireError as error:
                return _refusal(str(error))
        self.given.update(robots)
        return SetParametersResult(successful=True)

    def _use(self, _changes: list[Parameter]) -> None:
        if not self._mirroring:
            self._on_change()


def _refusal(reason: str) -> SetParametersResult:
    return SetParametersResult(successful=False, reason=reason)
