"""How coroutines wait for a link, whose thread is not their loop's."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from collections.abc import Awaitable, Callable
from contextvars import Context, copy_context
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, cast
from weakref import WeakValueDictionary

from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.parameters import PARAMETERS

from ..errors import InvalidCommand, LinkLost, WheelwireError, afresh
from ..link.connection import CLOSE_TIMEOUT_S, Link
from ..link.device_link import CALL_TIMEOUT_S, STEP_S, InlineLink
from ..link.requests import Answer, Done, RequestMessage
from ..link.sample_stream import LatestSample
from ..link.shared_thread import SharedThread
from ..link.threads import Notifier
from .calls import Requests

if TYPE_CHECKING:
    from .robot import Robot

LONGEST_RUN_S = 0.005
"""How long calls of other threads may follow each other before the loop's other tasks run."""


class LoopLink(Requests):
    """A link, and the loop that waits for it.

    One thread serves the ports of all links of a loop, and wakes it. In virtual time there is no
    such thread, and waiting makes time pass.
    """

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot._link)
        self.explanations = robot._explanations
        self.latest_sample: LatestSample = robot._latest_sample
        self._virtual = cast("InlineLink", self.link) if self.link.in_virtual_time else None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._calls: LoopCalls | None = None
        self._thread = 0
        self._guard: asyncio.Task[None] | None = None

    # --- opening and closing ---------------------------------------------------------------------

    async def open(self) -> None:
        """Open the link, which belongs to the running loop from now on."""
        self._loop = asyncio.get_running_loop()
        self._thread = threading.get_ident()
        self._calls = LoopCalls.of(self._loop)
        link = self.link
        if not isinstance(link, Link):
            link.open()
            return
        link.serve_by(self._calls.ports)
        # All are watched, so that each has a value without waiting: no subscript can be awaited.
        link.watch([definition.id for definition in PARAMETERS])
        self._guard = self._loop.create_task(
            _guard(link, self.wait_for), name=f"wheelwire {link.name}"
        )
        try:
            with self.explanations:
                for ready, timeout_s in link.opening():
                    await self.wait_for(link.changed, ready, timeout_s)
        except BaseException:
            # Also at a cancellation: otherwise the thread would go on serving a port that nothing
            # can close.
            await self.close()
            raise

    async def close(self) -> None:
        """Stop the robot and close the port; when this is cancelled, a moment later."""
        link, guard = self.link, self._guard
        if not isinstance(link, Link):
            link.close()
            return
        link.finish()
        if guard is not None and guard.get_loop() is asyncio.get_running_loop():
            # To await the task itself would cancel it along with the caller.
            await asyncio.wait([guard], timeout=CLOSE_TIMEOUT_S)

    def abandon(self) -> None:
        """Stop the robot of a link that is no longer used, without making a loop wait."""
        if isinstance(self.link, Link) and self._loop is not None and self._loop.is_running():
            self.link.finish()
        else:
            self.link.close()

    def check_thread(self) -> None:
        """Raise `InvalidCommand` in another thread than the loop's."""
        if threading.get_ident() != self._thread and not self.link.has_ended:
            raise InvalidCommand(
                "the robot belongs to an asyncio loop of another thread: have that loop call it, "
                "by loop.call_soon_threadsafe or asyncio.run_coroutine_threadsafe"
            )

    # --- waiting ---------------------------------------------------------------------------------

    def call_in_loop(self, call: Callable[[], None]) -> None:
        """Have the loop call it; from any thread, once the link is being opened."""
        if self._calls is not None:
            self._calls.add(call)

    async def wait_for(
        self, changed: Notifier, ready: Callable[[], bool], timeout_s: float | None = None
    ) -> bool:
        """Wait until `ready()`, or for `timeout_s`; returns whether it was. `changed` wakes it."""
        loop = self._own_loop()
        if self._virtual is not None:
            return await _pass_until(self._virtual, ready, timeout_s)
        end_s = None if timeout_s is None else loop.time() + timeout_s
        while not ready():
            if end_s is not None and loop.time() >= end_s:
                return False
            waiter = _Waiter(loop, self.call_in_loop)
            changed.add(waiter)
            # It ends the same wait: when time is up, `ready` is called again, too.
            timer = None if end_s is None else loop.call_at(end_s, waiter.end)
            try:
                # A change before it was added did not wake it.
                if not ready():
                    await waiter
            finally:
                changed.discard(waiter)
                if timer is not None:
                    timer.cancel()
        return True

    async def call(self, post: Callable[[Done], None]) -> Answer:
        """Send a request by `post`; wait for its result, and return or raise it.

        Cancelling this withdraws the request.
        """
        self._own_loop()
        results: list[Answer | WheelwireError] = []
        answered = Notifier()

        def done(result: Answer | WheelwireError) -> None:
            results.append(result)
            answered.notify_all()

        post(done)
        try:
            await self.wait_for(answered, lambda: bool(results), CALL_TIMEOUT_S)
        except BaseException:
            # A late copy would take effect after the program's next action.
            self.link.withdraw(done)
            raise
        if not results:
            self.link.withdraw(done)
            raise self.link.no_answer()
        with self.explanations:
            if isinstance(results[0], WheelwireError):  # the same may end many calls
                raise afresh(results[0])
        return results[0]

    async def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer."""
        return await self.call(partial(self.link.post, message))

    async def stop(self, mode: StopMode | None) -> None:
        """As `Link.stop`, or with None `Link.estop`."""
        await self.call(partial(self.link.post_stop, mode=mode))

    async def pause(self, seconds: float) -> None:
        """Wait."""
        if self._virtual is not None:
            self._virtual.advance(seconds)
            seconds = 0
        await asyncio.sleep(seconds)

    async def wait_for_sample(
        self, latest: LatestSample, ready: Callable[[], bool], timeout_s: float
    ) -> None:
        """As `Requests.wait_for_sample`, on the loop."""
        await self.wait_for(latest.changed, ready, timeout_s)

    def answer_to(self, message: RequestMessage) -> Answer:
        """Only in virtual time: anything else would block the loop."""
        if isinstance(self.link, Link):
            raise LinkLost("a new session is being opened; wait a moment")
        return super().answer_to(message)

    def _own_loop(self) -> asyncio.AbstractEventLoop:
        loop = asyncio.get_running_loop()
        # If the link has ended, the caller gets that error instead.
        if loop is not self._loop and not self.link.has_ended:
            raise InvalidCommand(
                "the robot belongs to another asyncio loop: use it in the one that opened it, as "
                "by asyncio.run_coroutine_threadsafe"
            )
        return loop


class LoopCalls:
    """What other threads have a loop call: one wake-up for all that comes until the loop runs it.

    Attributes:
        ports: The thread that serves the ports of the loop's links.
    """

    _of_loops: ClassVar[WeakValueDictionary[int, LoopCalls]] = WeakValueDictionary()
    """Keys are the loop's `id`, which no other object has while its `LoopCalls` refers to it."""

    @classmethod
    def of(cls, loop: asyncio.AbstractEventLoop) -> LoopCalls:
        """The one of this loop; call it in the loop."""
        found = cls._of_loops.get(id(loop))
        if found is None:
            found = cls._of_loops[id(loop)] = cls(loop)
        return found

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.ports = SharedThread(passed=self._wake)
        self._loop = loop
        self._calls: deque[Callable[[], None]] = deque()
        self._is_woken = False

    def add(self, call: Callable[[], None]) -> None:
        """Have the loop call it; from any thread."""
        self._calls.append(call)
        # The thread of the ports wakes the loop once it has served all that had something.
        if not self.ports.is_current_thread():
            self._wake()

    def _wake(self) -> None:
        # A loop that was closed does not run what it was woken for.
        if self._calls and (not self._is_woken or self._loop.is_closed()):
            self._is_woken = True
            try:
                self._loop.call_soon_threadsafe(self._run)
            except RuntimeError:  # the loop is closed
                self._is_woken = False
                self._calls.clear()

    def _run(self) -> None:
        self._is_woken = False  # first: what comes from now on wakes the loop again
        end_s = time.monotonic() + LONGEST_RUN_S
        try:
            while self._calls:
                self._calls.popleft()()
                if time.monotonic() >= end_s:
                    break
        finally:
            self._wake()  # for the rest of them, if time is up or a call has failed


class _Waiter(asyncio.Future[None]):
    """A coroutine that waits for another thread's news.

    It goes on within `end`, and not in the loop's next pass as with a plain future: before that the
    loop makes three system calls, and in each of them the thread of the ports may take the
    interpreter's lock.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        call_in_loop: Callable[[Callable[[], None]], None],
    ) -> None:
        super().__init__(loop=loop)
        self._call_in_loop = call_in_loop
        self._go_on: Callable[[_Waiter], object] = lambda _: None

    def add_done_callback(
        self, call: Callable[[Any], object], /, *, context: Context | None = None
    ) -> None:
        """Keep `call`, which resumes the coroutine; the task that awaits this sets it once."""
        run = (context or copy_context()).run
        self._go_on = lambda waiter: run(call, waiter)  # given, not held: no cycle is left behind

    def release(self) -> None:
        """End the wait; from any thread."""
        self._call_in_loop(self.end)

    def end(self) -> None:
        """End the wait; in the loop, but in no task of it."""
        if not self.done():
            self.set_result(None)
            self._go_on(self)

    def cancel(self, msg: Any = None) -> bool:
        """As every future: the coroutine learns of it in the loop's next pass."""
        was_waiting = super().cancel(msg)
        if was_waiting:
            self.get_loop().call_soon(self._go_on, self)
        return was_waiting


async def _pass_until(link: InlineLink, ready: Callable[[], bool], timeout_s: float | None) -> bool:
    """Let virtual time pass until `ready()`, or for `timeout_s`; returns whether it was ready."""
    end_us = None if timeout_s is None else link.now_us + round(timeout_s * 1e6)
    while not ready():
        if end_us is not None and link.now_us >= end_us:
            return False
        link.advance(STEP_S)
        await asyncio.sleep(0)  # lets others use the loop, and this be cancelled
    return True


async def _guard(link: Link, wait_for: Callable[..., Awaitable[bool]]) -> None:
    """The link's task: a loop that ends cancels it, and waits until the robot is stopped."""
    try:
        while not link.has_ended:
            try:
                await wait_for(link.changed, lambda: link.has_ended)
            except asyncio.CancelledError:  # noqa: PERF203 - it goes on waiting
                link.finish()
    finally:
        # Its thread is at its end, for which this waits; it has yet to stop the robot only if the
        # loop was closed without a word, and this is thrown away.
        link.close()
