"""The thread that serves a port.

Requests are handed to it as calls. So no lock is needed, a signal handler may make a request
whatever it interrupted, and an exception raised by a handler leaves nothing half done. Only
setpoints are written by the calling thread: waking another thread would take twice as long.
"""

from __future__ import annotations

import logging
import select
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from typing import TYPE_CHECKING

from ..errors import LinkClosed, LinkLost, WheelwireError
from .clock import host_clock_us
from .latest_sample import LatestSample
from .served_port import CLOSED, Changed, Done, OpenPort, ServedPort, Task
from .session import Session

if TYPE_CHECKING:
    from .transports import Transport

_log = logging.getLogger("wheelwire")


class PortLoop(ServedPort):
    """Serves a session on a port, through every loss of the port, until `finish`.

    Args: those of `ServedPort`. `call`, `send` and `finish` may be called by any thread, and by a
    signal handler.
    """

    def __init__(
        self,
        open_port: OpenPort,
        baud_rate: int,
        session: Session,
        changed: Changed,
        latest_sample: LatestSample,
        is_wanted: Callable[[], bool],
    ) -> None:
        self.opened: SimpleQueue[BaseException | None] = SimpleQueue()
        """Gets None once the port has been opened for the first time, or the error."""
        self._begun = threading.Lock()
        """Acquired once and never released, by `run` or by a `finish` that came before it."""
        # A socket can be polled along with the port, and a signal handler may write to it.
        self._wake_read, self._wake_write = socket.socketpair()
        # A full buffer must not block whoever wakes the loop, nor an empty one the loop.
        self._wake_read.setblocking(False)
        self._wake_write.setblocking(False)
        self._poller = select.poll()
        self._poller.register(self._wake_read, select.POLLIN)
        self._descriptor = -1
        self._wanted = 0
        """Of the port, and the events that are polled for."""
        # Last: from then on a fork of the process may call `abandon`, which needs what is above.
        super().__init__(open_port, baud_rate, session, changed, latest_sample, is_wanted)

    def wake(self) -> None:
        """Make the loop check the session; from any thread."""
        try:
            self._wake_write.send(b"\0")
        except OSError:  # full: it is awake already; closed: the loop has ended
            return

    def call(self, task: Task, done: Done) -> None:
        """Have the loop do `task`; from any thread. Never waits.

        `done` is called exactly once: by the task, with the error that the task raises, or with the
        reason why the loop ended.
        """
        self._calls.append((task, done))
        self.wake()
        if self.end is not None:  # the loop may have ended before it saw the call
            self._refuse_calls(self.end)

    def finish(self) -> None:
        """Stop the robot, close the port and end; from any thread, even from a finaliser.

        A loop that has not started yet ends here, and `run` then returns at once.
        """
        self._note_closing()
        # First: the loop looks at it as soon as it is woken.
        self._finishing = True
        self.wake()
        if self._begun.acquire(blocking=False):
            self._terminate(LinkClosed(CLOSED))

    def run(self) -> None:
        """Open, serve and reopen the port until the end: the thread's main function."""
        if not self._begun.acquire(blocking=False):
            return
        end: WheelwireError = LinkClosed(CLOSED)
        try:
            transport = self._open()
            while transport is not None:
                lost = self._serve(transport)
                transport = None  # its descriptors are freed with it
                if lost:
                    transport = self._reopen()
        except BaseException as error:
            # Told to all who wait: they would otherwise learn nothing but that time ran out.
            _log.exception("the link's thread failed")
            end = LinkClosed(f"the link's thread failed ({error!r}); open it again")
            end.__cause__ = error
        finally:
            self._warn_of_motion()
            self._terminate(end)

    def fail(self, error: Exception) -> None:
        """End before the start: the thread could not be created."""
        self._terminate(
            LinkClosed(f"the link's thread cannot be started ({error}): close other programs")
        )

    # -------------------------------------------------------------------------------------------

    def _open(self) -> Transport | None:
        """Open the port for the first time; None when that failed.

        In this thread and not the caller's, because no signal handler interrupts this one. An
        exception raised by a handler before the descriptor is stored would leave the port locked.
        """
        try:
            transport = self._open_port(self._first_baud_rate)
        except BaseException as error:
            self.opened.put(error)  # raised in the thread that opens the link
            return None
        self._connect(transport)
        self.opened.put(None)
        return transport

    def _reopen(self) -> Transport | None:
        """Retry until the port opens; None when the loop is to end."""
        while not self._is_ending():
            self._pause(self.policy.take_pause_s())
            # It may have been `finish` that ended the pause.
            if self._is_ending():
                break
            try:
                transport = self._open_port(self.policy.rate)
            except WheelwireError as error:
                self._note_failure(error)
            else:
                self._connect(transport)
                return transport
        return None

    def _pause(self, pause_s: float) -> None:
        """Wait that long, or until the loop is to end.

        Calls wake it, and fail with the reason why there is no session; they do not shorten the
        pause: opening a port may reset the board behind it.
        """
        end_us = host_clock_us() + round(pause_s * 1e6)
        while True:
            now_us = host_clock_us()
            self._do_calls(now_us)
            if now_us >= end_us or self._is_ending():
                return
            # Only for wake-ups: the lost port is not registered any more.
            self._poller.poll((end_us - now_us) / 1000)
            self._drain_wake_ups()

    def _serve(self, transport: Transport) -> bool:
        """Serve until the port is lost (True) or the loop ends (False). Closes the port."""
        self._descriptor, self._wanted = transport.fileno(), select.POLLIN
        self._poller.register(self._descriptor, self._wanted)
        self._transport = transport
        try:
            while not (self._finishing and self._last_stop_over()):
                self._turn(transport, self._wait_for_port())
        except LinkLost as error:
            self._lose(error)
            return True
        finally:
            # First, so that no other thread begins a write to a port that is being closed.
            self._transport = None
            self._poller.unregister(self._descriptor)
            transport.close()
            # A sample may have come in the turn that ended the serving.
            self._tell_news()
        return False

    def _wait_for_port(self) -> int:
        """Wait for a deadline, a wake-up or the port; return the port's poll events."""
        now_us = host_clock_us()
        until_us, rests = self._next_wait(now_us)
        wanted = 0 if rests else select.POLLIN
        if self._output:
            wanted |= select.POLLOUT
        if wanted != self._wanted:
            self._wanted = wanted
            self._poller.modify(self._descriptor, wanted)
        self._tell_news()
        found = 0
        for descriptor, events in self._poller.poll(max(0.0, (until_us - now_us) / 1000)):
            if descriptor == self._descriptor:
                found = events
            else:
                self._drain_wake_ups()
                self._work_pending = True
        # During the rest `poll` was not asked about data: read at its end without being told to.
        rested = rests and host_clock_us() >= self._coalescing.rest_until_us
        return found | select.POLLIN if rested else found

    def _drain_wake_ups(self) -> None:
        # However many came, one turn does for all of them.
        with suppress(BlockingIOError):
            self._wake_read.recv(4096)

    def _terminate(self, end: WheelwireError) -> None:
        super()._terminate(end)
        # For whoever still waits for the port: the end may have come before it was opened.
        self.opened.put(end)
        self._wake_read.close()
        self._wake_write.close()
