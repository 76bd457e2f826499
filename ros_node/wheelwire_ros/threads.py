"""The node's threads: what each one runs, and which of them may wait for the robot.

thread               callback group   runs
general callbacks    the default one  parameters, lifecycle, the other services; diagnostics at 1 Hz
 (the main thread)                    and at each change
urgent callbacks     `urgent_group`   cmd_vel, ~/estop and ~/stop; each 0.2 s who publishes cmd_vel
stop workers         (4 threads)      e-stop and stop, until acknowledged
request worker       (1 thread)       the robot's parameters, save, clear, preparing a new session
transition worker    (1 thread)       lifecycle transitions, and so connecting; autostart at 1 Hz
samples              (its own)        reads the robot; odom, tf, joint_states, what sensors measured
pose                 (its own)        writes pose_file, at most once a second

Only the workers and the thread of the samples wait for the robot.
An entity is created and destroyed in the thread that waits for it: `NodeExecutor.run`.
A callback that needs a worker is a coroutine: its executor runs other callbacks until the worker
has finished. So nothing that the robot does, or does not do, delays an e-stop, a command or the
answer of a parameter service.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import Any, TypeVar

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.task import Future as RosFuture

STOPS_AT_ONCE = 4
"""Stops that may wait for their acknowledgement; the next one would wait for one of these."""
SWITCH_INTERVAL_S = 0.0001
"""How long one thread may hold the interpreter while another has something to do. Python's 5 ms
is as long as an e-stop may take to the wire."""
JOIN_S = 2.0
GENERAL_PAUSE_S = 0.0005
"""Between two general callbacks. Otherwise a client that asks without end would let their thread
hold the interpreter all the time, and each e-stop would have to wait until it lets go."""
SPIN_ENDED_S = 0.1
"""How soon a caller finds out that an executor ended before it came to a callback."""

Result = TypeVar("Result")
Serve = Callable[[Any, Any], Any]
"""A service's callback: fills in the response to a request, and returns it."""


def steady_clock() -> Clock:
    """A clock for timers that must not depend on the wall clock or on /clock."""
    return Clock(clock_type=ClockType.STEADY_TIME)


class NodeExecutor(SingleThreadedExecutor):  # type: ignore[misc] # rclpy has no types
    """Runs the callbacks of one node whose group belongs to it, and no others.

    Args:
        node: An rclpy node.
        runs: Whether a callback group belongs to it.
        pause_s: After each callback.
    """

    def __init__(self, node: Any, runs: Callable[[Any], bool], pause_s: float = 0.0) -> None:
        super().__init__(context=node.context)
        self._pause_s = pause_s
        self._node = node
        self._runs = runs
        self.spins = threading.Event()
        """Set while `spin` runs."""
        self.started = threading.Event()
        """Set once `spin` has begun, also when it has ended since."""
        self._thread: int | None = None

    def spin(self) -> None:
        """Run callbacks until the context or this executor is shut down."""
        self._thread = threading.get_ident()
        self.spins.set()
        self.started.set()
        try:
            while self._context.ok() and not self._is_shutdown:
                self.spin_once()
                if self._pause_s:
                    time.sleep(self._pause_s)
        finally:
            self.spins.clear()

    def run(self, call: Callable[[], Result]) -> Result:
        """Make a call in the thread that spins, and wait for it; returns or raises as the call.

        If no thread spins, this one makes the call.
        """
        if not self.spins.is_set() or self._thread == threading.get_ident():
            return call()
        done: Future[Result] = Future()

        def run() -> None:
            try:
                done.set_result(call())
            except Exception as error:
                done.set_exception(error)

        # A task, not a guard condition: rclpy marks a triggered one on the node's side, so that
        # either executor could run it.
        self.create_task(run)
        while not wait([done], SPIN_ENDED_S).done:
            if not self.spins.is_set() and not done.done():  # the executor ended before the task
                run()
        return done.result()

    def get_nodes(self) -> list[Any]:
        """The node. It knows one executor only, and wakes that one when it has a new entity."""
        return [self._node]

    def can_execute(self, entity: Any) -> bool:
        """Whether to wait for an entity now."""
        return self._runs(entity.callback_group) and bool(super().can_execute(entity))


class NodeThreads:
    """The executors and workers of one node, from `spin` to `close`.

    Args:
        node: An rclpy node.

    Attributes:
        urgent_group: The callback group of what must not wait for other callbacks. While the
            threads run, create and destroy its entities by `urgent.run`.
        general: The executor of all others; `create_task` has it make a call soon.
        urgent: The executor of that group.
        stops: The workers for e-stop and stop.
        requests: The worker for what asks the robot.
        transitions: The worker for lifecycle transitions.
    """

    def __init__(self, node: Any) -> None:
        self.urgent_group = ReentrantCallbackGroup()
        self.stops = ThreadPoolExecutor(STOPS_AT_ONCE, "wheelwire stops")
        self.requests = ThreadPoolExecutor(1, "wheelwire requests")
        self.transitions = ThreadPoolExecutor(1, "wheelwire transitions")
        self.general = NodeExecutor(
            node, lambda group: group is not self.urgent_group, GENERAL_PAUSE_S
        )
        # The urgent one finds the node by `get_nodes` alone: a node belongs to one executor.
        self.general.add_node(node)
        self.urgent = NodeExecutor(node, lambda group: group is self.urgent_group)
        self._thread = threading.Thread(target=self._run_urgent, name="urgent callbacks")

    def spin(self) -> None:
        """Run all callbacks until the context is shut down; raises what a callback raises."""
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        self._thread.start()
        # Before it spins, `run` would make its call in the caller's thread.
        self.urgent.started.wait()
        self.general.spin()

    def close(self) -> None:
        """End the executors, and wait for a running transition.

        The other workers finish what they have begun, and begin nothing new.
        """
        for worker in (self.stops, self.requests):
            worker.shutdown(wait=False, cancel_futures=True)
        # The transition may be opening the robot, which the node then has to close.
        self.transitions.shutdown(wait=True, cancel_futures=True)
        self.urgent.shutdown(0)
        if self._thread.is_alive():
            self._thread.join(JOIN_S)
        self.general.shutdown(0)

    def fail(self, error: Exception) -> None:
        """Make `spin` raise the error; from any thread."""

        def raise_it() -> None:
            raise error

        # An executor raises what its tasks raise, out of `spin`.
        self.general.create_task(raise_it)

    def defer(
        self,
        service: Any,
        worker: ThreadPoolExecutor,
        waits: Callable[[Any], bool] = lambda _request: True,
    ) -> None:
        """Have a worker serve the requests that wait for the robot.

        Args:
            service: A service of the node; this replaces its callback.
            worker: Where that callback runs from now on.
            waits: Whether a request waits for the robot; the service's thread serves the others.
        """
        serve_now: Serve = service.callback
        is_urgent = service.callback_group is self.urgent_group
        executor = self.urgent if is_urgent else self.general

        async def serve(request: Any, response: Any) -> Any:
            if not waits(request):
                return serve_now(request, response)
            return await self._done(executor, worker.submit(serve_now, request, response))

        service.callback = serve
        if not is_urgent:
            # A coroutine occupies its group until it ends, and the default one has other callbacks.
            service.callback_group = ReentrantCallbackGroup()

    @staticmethod
    async def _done(executor: SingleThreadedExecutor, called: Future[Result]) -> Result:
        """Wait for a worker's call, as a coroutine of an executor."""
        done = RosFuture(executor=executor)

        def finish(_: object) -> None:
            # Only a signal: the coroutine takes the result or the error from the call itself.
            done.set_result(None)
            executor.wake()  # rclpy looks at waiting coroutines only when something has come

        called.add_done_callback(finish)
        await done
        return called.result()

    def _run_urgent(self) -> None:
        try:
            with suppress(ExternalShutdownException):
                self.urgent.spin()
        except Exception as error:
            # Otherwise only this thread would end: the node would live on, and obey no command.
            self.fail(error)
