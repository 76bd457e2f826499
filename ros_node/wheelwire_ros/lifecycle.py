"""What rclpy's lifecycle nodes lack: an automatic start, and an answer to an invalid request."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import TransitionCallbackReturn

from .threads import NodeThreads

AUTOSTART_PERIOD_S = 1.0


class Autostart:
    """Configures and activates a node as soon as it spins, and retries until that works.

    Args:
        node: A lifecycle node. It calls `end` when it is configured or shut down, whoever asked
            for that: from then on its state is the user's to change.
    """

    def __init__(self, node: Any, threads: NodeThreads) -> None:
        self._node = node
        self._threads = threads
        self._timer = node.create_timer(AUTOSTART_PERIOD_S, self._begin, clock=steady_clock())
        self._is_trying = False
        threads.call_soon(self._begin)  # at once, not after the first period

    def end(self) -> None:
        """Stop trying."""
        self._timer.cancel()

    def _begin(self) -> None:
        # An attempt on a silent robot takes longer than a period: they must not queue up.
        if self._timer.is_canceled() or self._is_trying:
            return
        self._is_trying = True
        with suppress(RuntimeError):  # the lane is closed
            self._threads.transitions.submit(self._attempt)

    def _attempt(self) -> None:
        try:
            if self._timer.is_canceled():  # meanwhile
                return
            if self._node.trigger_configure() == TransitionCallbackReturn.SUCCESS:
                self._node.trigger_activate()
            self._node.update_state()
        except Exception as error:
            self._threads.fail(error)
        finally:
            self._is_trying = False


def steady_clock() -> Clock:
    """A clock for timers that must not depend on the wall clock or on /clock."""
    return Clock(clock_type=ClockType.STEADY_TIME)


def defer_transitions(node: Any, threads: NodeThreads) -> None:
    """Serve transitions in their lane, and refuse those that the current state does not have.

    rclpy lets the error of such a transition escape from the service's callback, which ends the
    node; a lifecycle manager that configures a node which has started by itself would trigger that.
    """
    for service in node.services:
        if service.srv_type is ChangeState:
            # First this one: `defer` takes the callback that it finds into the lane.
            service.callback = _refusing(node, service.callback)
            threads.defer(service, threads.transitions)


def _refusing(node: Any, change_state: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    def serve(request: ChangeState.Request, response: ChangeState.Response) -> Any:
        try:
            return change_state(request, response)
        except RuntimeError as error:  # of the state machine; a transition handles its own errors
            node.get_logger().warning(str(error))
            response.success = False
            return response
        finally:
            node.update_state()

    return serve
