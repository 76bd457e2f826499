"""Functions of the application that a driver calls: `on_lost`, `on_opened`, `on_fault`."""

from __future__ import annotations

import threading
import weakref
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from functools import partial
from inspect import iscoroutinefunction
from queue import SimpleQueue
from typing import Any, TypeAlias

from ..errors import InvalidArgument, WheelwireError, shown
from ..link import LOG
from ..link.threads import Notifier
from ..link.traffic import Happening, Listener, Notice, StandingNotice

LAST_CALL_S = 1.0
"""How long closing waits for a callback that runs; calls of the robot in there end at once."""

Handler: TypeAlias = Callable[[Any], object]


class _Assignment:
    """A function that was assigned, and whether it was called since."""

    def __init__(self, handler: Handler) -> None:
        self.handler = handler
        self.was_called = False


class Callbacks(ABC):
    """At most one function for each happening, called one after the other, in order."""

    def __init__(self) -> None:
        self._assigned: dict[Happening, _Assignment] = {}

    def get(self, happening: Happening) -> Handler | None:
        """The function that is called, if one is."""
        assigned = self._assigned.get(happening)
        return None if assigned is None else assigned.handler

    def set(self, happening: Happening, handler: Handler | None) -> None:
        """Call `handler` from now on; with None call nothing.

        Raises:
            InvalidArgument: It cannot be called.
        """
        if handler is None:
            self._assigned.pop(happening, None)
            return
        if not callable(handler):
            raise InvalidArgument(f"{happening.value} = {shown(handler)}: give a function, or None")
        self._check(happening, handler)
        self._assigned[happening] = _Assignment(handler)

    @property
    @abstractmethod
    def listener(self) -> Listener:
        """Takes each notice; refers to no function of the application."""

    @abstractmethod
    def close(self) -> None:
        """Begin no call from now on. Never waits."""

    def _handler_for(self, notice: Notice) -> Handler | None:
        """The function that is to be called now for `notice`, if one is."""
        assigned = self._assigned.get(notice[0])
        # An event between the assignment and the link's learning of it is reported twice: as an
        # event, and then as the present state.
        if assigned is None or (assigned.was_called and isinstance(notice, StandingNotice)):
            return None
        assigned.was_called = True
        return assigned.handler

    def _check(self, happening: Happening, handler: Handler) -> None:
        """Raise `InvalidArgument` for a function that would have to be awaited."""
        check_plain(happening.value, handler)


def check_plain(name: str, handler: object) -> None:
    """Raise `InvalidArgument` for what cannot be called, or would have to be awaited."""
    if not callable(handler):
        raise InvalidArgument(f"{name} = {shown(handler)}: give a function")
    # Also an object whose `__call__` is one, and a partial of one.
    if iscoroutinefunction(unwrapped(handler)) or iscoroutinefunction(type(handler).__call__):
        raise InvalidArgument(
            f"{name} = {shown(handler)}: give a plain function; coroutines are for robots of "
            "wheelwire.aio"
        )


def unwrapped(handler: object) -> object:
    """The function within partials."""
    while isinstance(handler, partial):
        handler = handler.func
    return handler


def log_failure(happening: Happening) -> None:
    """Log the exception that a function of the application has raised."""
    LOG.exception("%s raised an exception; the link goes on", happening.value)


class Inbox:
    """The notices that were not reported yet; refers to no function of the application."""

    def __init__(self) -> None:
        self.notices: SimpleQueue[Notice | None] = SimpleQueue()
        self.closed = False

    def close(self) -> None:
        """Begin no call from now on, and end the thread. Never waits."""
        self.closed = True
        self.notices.put(None)


class ThreadCallbacks(Callbacks):
    """Calls the functions on a thread of its own, where they may call the robot.

    It starts with the first function that is set, and ends when the driver is closed or forgotten.
    """

    def __init__(self) -> None:
        super().__init__()
        self.inbox = Inbox()
        self._thread: threading.Thread | None = None
        self._calling = False
        self._changed = Notifier()

    @property
    def listener(self) -> Listener:
        """Queues each notice."""
        return self.inbox.notices.put

    def set(self, happening: Happening, handler: Handler | None) -> None:
        """As `Callbacks.set`; starts the thread."""
        super().set(happening, handler)
        if handler is None or self._thread is not None or self.inbox.closed:
            return
        # Weakly, because the functions commonly refer to the driver: when the driver is forgotten,
        # this thread ends.
        self._thread = threading.Thread(
            target=_run,
            args=(weakref.ref(self), self.inbox.notices),
            name="wheelwire callbacks",
            daemon=True,
        )
        try:
            self._thread.start()
        except RuntimeError as error:
            self._thread = None
            raise WheelwireError(
                f"the thread that calls {happening.value} cannot be started ({error}): "
                "close other programs"
            ) from error

    def close(self) -> None:
        """As `Callbacks.close`; the thread ends after the call that is under way."""
        self.inbox.close()

    def wait(self) -> None:
        """Wait a moment for the end of a call, unless it is that call which waits."""
        thread = self._thread
        if thread is None or threading.current_thread() is thread:
            return
        if self._changed.wait_for(lambda: not self._calling, LAST_CALL_S):
            thread.join(LAST_CALL_S)

    def call(self, notice: Notice) -> bool:
        """Call the function for what has happened; False once closed."""
        happening, told = notice
        # In this order: `close` looks at the one after it has set the other.
        self._calling = True
        try:
            if self.inbox.closed:
                return False
            handler = self._handler_for(notice)
            if handler is not None:
                handler(told)
        except BaseException:  # also an exit: it would end this thread alone, and without a word
            log_failure(happening)
        finally:
            self._calling = False
            self._changed.notify_all()
        return True


def _run(callbacks: weakref.ref[ThreadCallbacks], queue: SimpleQueue[Notice | None]) -> None:
    """The thread's main function."""
    while (notice := queue.get()) is not None:
        this = callbacks()
        if this is None or not this.call(notice):
            return
        # While it waits, it must not keep either of them alive.
        del this, notice


class InlineCallbacks(Callbacks):
    """Calls the functions in the call that lets virtual time pass: one thread uses such a robot."""

    def __init__(self) -> None:
        super().__init__()
        self._notices: deque[Notice] = deque()
        self._calling = False
        self._closed = False

    @property
    def listener(self) -> Listener:
        """Calls at once; a notice that comes during a call waits for its end."""
        return self._tell

    def _tell(self, notice: Notice) -> None:
        self._notices.append(notice)
        if self._calling:
            return
        self._calling = True
        try:
            while self._notices and not self._closed:
                notice = self._notices.popleft()
                handler = self._handler_for(notice)
                if handler is not None:
                    try:
                        handler(notice[1])
                    except Exception:
                        log_failure(notice[0])
        finally:
            self._calling = False

    def close(self) -> None:
        """As `Callbacks.close`."""
        self._closed = True

    def wait(self) -> None:
        """No call is under way, except one that this is called from."""
