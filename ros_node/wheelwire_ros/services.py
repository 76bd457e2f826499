"""The node's services. Each answers with success, or with the reason of its failure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from std_srvs.srv import SetBool, Trigger

from wheelwire import WheelwireError

from .open_robot import OpenRobot
from .threads import NodeThreads

SEEN_WHEN_DRIVEN = ("NOT_COUNTING", "REVERSED", "IMPLAUSIBLE")
"""Ends of fault names whose cause shows only while the wheel is driven."""
STOPPED_BY_DEADLINE = "the last command ends at its deadline"


def create_services(node: Any, threads: NodeThreads) -> None:
    """Create the services, named below the node's name.

    Args:
        node: A `HardwareRobot`.
        threads: The node's.
    """

    def estop(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        def act() -> str:
            if request.data:
                node.set_estop()
                return "e-stopped"
            return str(node.clear_estop())

        answer = _answer(act, response)
        # After a failure as well: the node remembers the e-stop of a robot out of reach.
        node.update_state()
        return answer

    def trigger(action: Callable[[OpenRobot], str]) -> Callable[[Any, Any], Any]:
        return lambda _request, response: _answer(lambda: action(node.open_robot()), response)

    urgent, stops, requests = threads.urgent_group, threads.stops, threads.requests
    for type_, name, serve, group, worker in (
        (SetBool, "estop", estop, urgent, stops),
        (Trigger, "stop", trigger(_stop), urgent, stops),
        (Trigger, "clear_fault", trigger(_clear_fault), None, requests),
        (Trigger, "save_parameters", trigger(_save_parameters), None, requests),
        # In the general thread, because it does not ask the robot.
        (Trigger, "reset_odometry", trigger(_reset_odometry), None, None),
    ):
        service = node.create_service(type_, f"~/{name}", serve, callback_group=group)
        if worker is not None:
            threads.defer(service, worker)


def _stop(robot: OpenRobot) -> str:
    try:
        robot.connection.stop()
    except WheelwireError as error:
        raise WheelwireError(f"{error}; {STOPPED_BY_DEADLINE}") from error
    return "stopped, until the next command"


def _clear_fault(robot: OpenRobot) -> str:
    # Read first: a cleared fault leaves no trace.
    faults = robot.state().fault_names.split()
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
    robot.reset_odometry()
    return "the odometry begins here"


def _answer(action: Callable[[], str], response: Any) -> Any:
    try:
        response.message = action()
    except WheelwireError as error:
        response.message = str(error)
    else:
        response.success = True
    return response
