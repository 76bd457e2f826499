"""What rclpy's lifecycle nodes lack: a start by themselves, and an answer to a wrong request."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import TransitionCallbackReturn

AUTOSTART_PERIOD_S = 1.0


class Autostart:
    """Configures and activates a node as soon as it is spun, again until that works.

    Args:
        node: A lifecycle node that calls `end` once it is configured or shut down; from then on
            whoever changes its state is in charge.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        self._timer = node.create_timer(AUTOSTART_PERIOD_S, self._attempt, clock=steady_clock())
        node.create_guard_condition(self._attempt).trigger()  # now, not in a period

    def end(self) -> None:
        """Nothing is started any more."""
        self._timer.cancel()

    def _attempt(self) -> None:
        if self._timer.is_canceled():
            return
        if self._node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
            self._node.trigger_activate()


def steady_clock() -> Clock:
    """For timers that go on whatever becomes of the wall clock or of /clock."""
    return Clock(clock_type=ClockType.STEADY_TIME)


def refuse_impossible_transitions(node: Any) -> None:
    """Answer a transition that the state does not have with `success: false`.

    rclpy lets the error out of the service's callback, and so end the node: a lifecycle manager
    that configures a node which has started by itself would be enough.
    """
    for service in node.services:
        if service.srv_type is ChangeState:
            service.callback = _refusing(node, service.callback)


def _refusing(node: Any, change_state: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def serve(request: ChangeState.Request, response: ChangeState.Response) -> Any:
        try:
            return change_state(request, response)
        except RuntimeError as error:  # only the state machine's: transitions keep theirs
            node.get_logger().warning(str(error))
            response.success = False
            return response

    return serve
