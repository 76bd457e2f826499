"""Functions and coroutines of the application that a driver for asyncio calls."""

from __future__ import annotations

import asyncio
import weakref
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from inspect import isawaitable

from ..link.traffic import Happening, Listener, Notice
from .callbacks import LAST_CALL_S, Callbacks, Handler, log_failure


class LoopCallbacks(Callbacks):
    """Calls the functions in a task of the loop, and awaits a coroutine before the next call.

    Args:
        call_in_loop: Calls its argument in the loop, from any thread.
    """

    def __init__(self, call_in_loop: Callable[[Callable[[], None]], None]) -> None:
        super().__init__()
        self._call_in_loop = call_in_loop
        self._notices: deque[Notice] = deque()
        self._task: asyncio.Task[None] | None = None
        self._awaited: asyncio.Future[object] | None = None
        self._closed = False

    @property
    def listener(self) -> Listener:
        """Queues each notice for a task that calls the functions; for the link's thread."""
        # Weakly: the functions commonly refer to the driver, which the port must not keep alive.
        this, call_in_loop = weakref.ref(self), self._call_in_loop

        def tell(notice: Notice) -> None:
            callbacks = this()
            if callbacks is not None:
                callbacks.tell(notice)

        return lambda notice: call_in_loop(partial(tell, notice))

    def tell(self, notice: Notice) -> None:
        """Call the function for a notice, after the functions for earlier notices."""
        if self._closed or self.get(notice[0]) is None:
            return
        self._notices.append(notice)
        if self._task is None or self._task.done():  # an eager task is done at once
            with suppress(RuntimeError):  # the loop has been closed
                self._task = asyncio.get_running_loop().create_task(
                    self._run(), name="wheelwire callbacks"
                )

    def close(self) -> None:
        """As `Callbacks.close`."""
        self._closed = True

    async def wait(self) -> None:
        """Wait a moment for the end of a call, unless it is that call which waits."""
        task, current = self._task, asyncio.current_task()
        if task is not None and current is not task and current is not self._awaited:
            await asyncio.wait([task], timeout=LAST_CALL_S)

    async def _run(self) -> None:
        try:
            while self._notices and not self._closed:
                notice = self._notices.popleft()
                handler = self._handler_for(notice)
                if handler is not None:
                    try:
                        result = handler(notice[1])
                        if isawaitable(result):
                            await self._finish(result)
                    except Exception:
                        log_failure(notice[0])
        finally:
            # There is no await between the last check of the queue and this.
            self._task = None

    async def _finish(self, result: Awaitable[object]) -> None:
        # A task of its own: one that cancels itself does not end the calls after it.
        self._awaited = awaited = asyncio.ensure_future(result)
        try:
            await asyncio.wait([awaited])
        finally:
            awaited.cancel()  # if this task was cancelled; otherwise it is done
            self._awaited = None
        if awaited.cancelled():
            raise RuntimeError("it was cancelled")
        awaited.result()

    def _check(self, happening: Happening, handler: Handler) -> None:
        """Accept everything: a coroutine is as good as a plain function."""
