"""The node's services. Each answers with success or with the reason of its failure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from std_srvs.srv import SetBool, Trigger

from wheelwire import WheelwireError

from .connection import RobotConnection
from .estimator import MotionEstimator


class RobotServices:
    """The services, named below the node's name.

    Args:
        node: An rclpy node.
        connection: The connection to the robot.
        estimator: The estimator whose pose `reset_odometry` resets.
    """

    def __init__(self, node: Any, connection: RobotConnection, estimator: MotionEstimator) -> None:
        self._node = node
        self._connection = connection
        actions: dict[str, Callable[[], None]] = {
            "clear_fault": connection.clear_fault,
            "reset_odometry": estimator.reset,
            "save_parameters": connection.save_parameters,
        }
        self._services = [node.create_service(SetBool, "~/estop", self._estop)]
        for name, action in actions.items():
            service = node.create_service(Trigger, f"~/{name}", _trigger(action))
            self._services.append(service)

    def destroy(self) -> None:
        """Remove the services."""
        for service in self._services:
            self._node.destroy_service(service)

    def _estop(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        connection = self._connection
        action = connection.estop if request.data else connection.clear_estop
        return _answer(action, response)


def _trigger(action: Callable[[], None]) -> Callable[[Any, Any], Any]:
    def serve(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        return _answer(action, response)

    return serve


def _answer(action: Callable[[], None], response: Any) -> Any:
    try:
        action()
    except WheelwireError as error:
        response.message = str(error)
    else:
        response.success = True
    return response
