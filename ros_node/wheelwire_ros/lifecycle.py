"""What rclpy's lifecycle nodes lack: an automatic start, and an answer to an invalid request."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import TransitionCallbackReturn

AUTOSTART_PERIOD_S = 1.0


class Autostart:
    """Configures and activates a node as soon as it spins, and retries until that works.

    Args:
        node: A lifecycle node. It calls `end` when it is configured or shut down, whoever asked
            for that: from then on its state is the user's to change.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._timer = node.create_timer(AUTOSTART_PERIOD_S, self._attempt, clock=steady_clock())
        node.create_guard_condition(self._attempt).trigger()  # at once, not after the first period

    def end(self) -> None:
        """Stop trying."""
        self._timer.cancel()

    def _attempt(self) -> None:
        if self._timer.is_canceled():
            return
        if self._node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self._node.trigger_activate()


def steady_clock() -> Clock:
    """A clock for timers that must not depend on the wall clock or on /clock."""
    return Clock(clock_type=ClockType.STEADY_TIME)


def refuse_impossible_transitions(node: Any) -> None:
    """Answer a transition that is not possible in the current state with `success: false`.

    rclpy lets the error escape from the service's callback, which ends the node; a lifecycle
    manager that configures a node which has started by itself would trigger that.
    """
    for service in node.services:
        if service.srv_type is ChangeState:
            service.callback = _refusing(node, service.callback)


def _refusing(node: Any, change_state: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def serve(request: ChangeState.Request, response: ChangeState.Response) -> Any:
        try:
            return change_state(request, response)
        except RuntimeError as error:  # of the state machine; a transition handles its own errors
            node.get_logger().warning(str(error))
            response.success = False
            return response

    return serve
