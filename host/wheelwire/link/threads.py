"""Waiting for what another thread does, in any thread and in a signal handler.

`threading.Condition` and `threading.Event` take their lock in Python code. An exception that a
signal handler raises there leaves the lock held for ever; a handler that calls a method of its
own while the main thread is in there waits for itself. Here nothing is locked: each wait has a
lock of its own, which no other call ever needs, and every step is one call into C.

A forked process has none of its parent's threads, so it closes what they serve, above all open
ports. It has a copy of every descriptor: a port would stay locked after the parent closed it.
"""

from __future__ import annotations

import _thread
import os
import threading
import time
from collections.abc import Callable
from io import FileIO
from typing import Protocol
from weakref import WeakSet


class Waiter(Protocol):
    """One that waits, once: a lock that is held, or a coroutine's future."""

    def release(self) -> None:
        """End the wait; called by any thread. Never waits."""


class Notifier:
    """Wakes all that wait. A thread never waits without a limit."""

    def __init__(self) -> None:
        self.waiting: set[Waiter] = set()
        """The waiting threads. If this is empty, `notify_all` need not be called."""

    def notify_all(self) -> None:
        """Wake all waiters; each checks its condition again. Never waits."""
        # A copy of the present waiters: a woken one may be waiting again before this ends, and must
        # not be woken in place of another.
        for woken in tuple(self.waiting):
            try:  # not `suppress`, which is three calls of Python
                self.waiting.remove(woken)
            except KeyError:  # the waiter has just given up
                continue
            woken.release()

    def add(self, waiter: Waiter) -> None:
        """Release `waiter` at the next change. It checks for earlier changes itself, after this."""
        self.waiting.add(waiter)

    def discard(self, waiter: Waiter) -> None:
        """Forget a waiter that has given up, or was released."""
        self.waiting.discard(waiter)

    def wait_for(self, ready: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until `ready()`, or for `timeout_s`; returns whether it was ready."""
        end_s = time.monotonic() + timeout_s
        while not ready():
            left_s = end_s - time.monotonic()
            if left_s <= 0:
                return False
            woken = threading.Lock()
            # Held from the start: acquiring it again waits until `notify_all` releases it.
            woken.acquire(blocking=False)
            self.waiting.add(woken)
            try:
                # A change before we were in the set did not wake us.
                if not ready():
                    woken.acquire(timeout=left_s)
            finally:
                self.waiting.discard(woken)
        return True


def start_without_waiting(thread: threading.Thread, fail: Callable[[RuntimeError], None]) -> None:
    """Start a thread; `fail` is called, by any thread, if none can be started.

    Thread.start() waits for an Event: an exception out of a signal handler in there can leave the
    new thread waiting for ever. No handler interrupts a thread but the main.
    """

    def start() -> None:
        try:
            thread.start()
        except RuntimeError as error:
            fail(error)

    try:
        _thread.start_new_thread(start, ())
    except RuntimeError as error:
        fail(error)


class WakeUp:
    """Ends the wait of a thread that polls, which polls this along with its ports."""

    def __init__(self) -> None:
        reader, writer = os.pipe()
        # As files, for these know that they were closed: another file may have their number then.
        self._reader, self._writer = FileIO(reader), FileIO(writer, "w")
        # A full buffer must not block the caller of `wake`, nor an empty one the thread.
        os.set_blocking(reader, False)
        os.set_blocking(writer, False)

    def fileno(self) -> int:
        """The descriptor that is readable once `wake` was called."""
        return self._reader.fileno()

    def wake(self) -> None:
        """Wake the thread; from any thread, and from a signal handler. Never waits."""
        try:  # not `suppress`, which is three calls of Python
            self._writer.write(b"\0")  # full: it is awake already, and this writes nothing
        except (ValueError, OSError):  # closed: it has ended
            return

    def drain(self) -> None:
        """Have it no longer readable: one pass of the thread does for all calls of `wake`."""
        self._reader.read(4096)

    def close(self) -> None:
        """Free the descriptors. Safe to call more than once, and concurrently with `wake`."""
        # In this order: who still writes finds a closed file, and not a pipe that nobody reads, for
        # which a program may have a signal end it.
        self._writer.close()
        self._reader.close()


this_thread = threading.local()
"""What `holds_ports_up` finds of the thread that asks."""


def holds_ports_up() -> bool:
    """Whether the calling thread serves ports of several links, or such a thread waits for it.

    It must not wait for any link, not even in a finaliser: meanwhile no robot could be stopped.
    """
    return getattr(this_thread, "holds_ports_up", False)


# --- forked processes -----------------------------------------------------------------------------


class Abandonable(Protocol):
    """Something that belongs to the process that created it."""

    def abandon(self) -> None:
        """Release this process's copy without affecting the parent's."""


_held: WeakSet[Abandonable] = WeakSet()


def abandon_in_child(thing: Abandonable) -> None:
    """Abandon `thing` in every child that this process forks, for as long as it exists."""
    _held.add(thing)


def _after_fork_in_child() -> None:
    for thing in list(_held):
        thing.abandon()
    # They are over in this process: a child that it forks has nothing left to abandon.
    _held.clear()


os.register_at_fork(after_in_child=_after_fork_in_child)
