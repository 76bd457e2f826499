"""The node's services. Each answers with success, or with the reason of its failure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from std_srvs.srv import SetBool, Trigger

from wheelwire import WheelwireError

from .open_robot import OpenRobot
from .threads import NodeThreads

SEEN_WHEN_DRIVEN = ("NOT_COUNTING", "REVERSED", "IMPLAUSIBLE")
"""Ends of the names of faults whose cause shows only while the wheel is driven."""
STOPPED_BY_DEADLINE = "the last command ends at its deadline"


class RobotServices:
    """The services, named below the node's name.

    Args:
        node: A `BaseRobotNode`.
        threads: The node's.
    """

    def __init__(self, node: Any, threads: NodeThreads) -> None:
        self._node = node
        threads.urgent_service(node, SetBool, "~/estop", self._estop)
        threads.urgent_service(node, Trigger, "~/stop", self._trigger(_stop))
        waiting = {"clear_fault": _clear_fault, "save_parameters": _save_parameters}
        for name, action in waiting.items():
            service = node.create_service(Trigger, f"~/{name}", self._trigger(action))
            threads.defer(service, threads.requests)
        # In the general thread, since it does not ask the robot.
        node.create_service(Trigger, "~/reset_odometry", self._trigger(_reset_odometry))

    def _estop(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        def act() -> str:
            if request.data:
                self._node.set_estop()
                return "e-stopped"
            return str(self._node.clear_estop())

        answer = _answer(act, response)
        # After a failure as well: the node remembers the e-stop of a robot out of reach.
        self._node.update_state()
        return answer

    def _trigger(self, action: Callable[[OpenRobot], str]) -> Callable[[Any, Any], Any]:
        def serve(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            return _answer(lambda: action(self._node.open_robot()), response)

        return serve


def _stop(robot: OpenRobot) -> str:
    try:
        robot.connection.stop()
    except WheelwireError as error:
        raise WheelwireError(f"{error}; {STOPPED_BY_DEADLINE}") from error
    return "stopped, until the next command"


def _clear_fault(robot: OpenRobot) -> str:
    # Read first: a cleared fault leaves no trace.
    faults = robot.faults
    robot.clear_fault()
    again = [fault for fault in faults if fault.endswith(SEEN_WHEN_DRIVEN)]
    if not again:
        return "cleared"
    return (
        f"cleared; but the cause of {' and '.join(again)} shows only while the wheel is driven: if "
        "it is still there, the fault returns with the next command"
    )


def _save_parameters(robot: OpenRobot) -> str:
    robot.connection.save_parameters()
    return "saved"


def _reset_odometry(robot: OpenRobot) -> str:
    robot.estimator.reset()
    return "the odometry begins here"


def _answer(action: Callable[[], str], response: Any) -> Any:
    try:
        response.message = action()
    except WheelwireError as error:
        response.message = str(error)
    else:
        response.success = True
    return response
