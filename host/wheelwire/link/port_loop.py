"""The loop that owns a port and the session on it.

What an application asks for is handed over as a call, which the loop carries out between two
reads. So nothing is locked, a signal handler may ask whatever the main thread was doing, and an
exception out of one leaves nothing half done. Setpoints alone are written by the thread that gives
them (`send`), one frame in one system call: waking another thread would take twice as long.
"""

from __future__ import annotations

import logging
import select
import socket
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from typing import TypeAlias

from wheelwire_protocol.codes import StopMode
from wheelwire_protocol.framing import MAX_ENCODED

from ..errors import LinkClosed, LinkLost, PortUnavailable, WheelwireError, WrongBoard
from .clock import SuspendWatch, host_clock_us
from .forking import abandon_in_child
from .latest_sample import LatestSample
from .reconnect import BaudSearch, Coalescing
from .requests import Answer
from .session import Phase, Session
from .setpoints import REPEAT_AFTER_US
from .transports import Transport
from .waiting import Notifier

FIRST_PAUSE_S = 0.05
"""Between two attempts to open the port; each further one waits twice as long."""
STOP_ACK_TIMEOUT_US = 500_000
"""How long the end waits for the device to acknowledge the stop."""
IDLE_US = 1_000_000
"""How long the loop may sleep when nothing is due."""
UNANSWERED_US = 1_000_000
"""A device that has answered at this port, and then does not: the port may be what is wrong."""
CHECK_US = 1_000_000
"""Between two looks at the port's settings."""
WRONG_BOARD_PAUSE_S = 1.0
"""Opening a port may reset the board there, and another program may want that one."""
OUTPUT_LIMIT = 4096
"""Bytes that wait for the port at most: soon they are worth nothing to a robot."""
CLOSED = "the link is closed; open it again"
MAX_FRAME = MAX_ENCODED + 2
_BROKEN = select.POLLHUP | select.POLLERR | select.POLLNVAL

Done: TypeAlias = Callable[[Answer | WheelwireError | None], None]
Task: TypeAlias = Callable[[Done, int], None]
"""Uses the session at a time; passes on `done`, or calls it, or raises."""

_log = logging.getLogger("wheelwire")


class _Unanswered(LinkLost):
    """The port is there; it is opened anew because nobody answers."""


class PortLoop:
    """Serves a session on a port, through every loss of the port, until `finish`.

    Args:
        open_port: Opens the port at a baud rate, or raises why not; called again whenever the port
            was lost. The loop closes what it returns.
        baud_rate: Tried first.
        session: Not connected yet. Others may look at it, and change nothing.
        changed: Notified when the session opens, ends or fails to open.
        latest_sample: Takes the samples.
        is_wanted: Whether anybody is left who could use the link, or finish it.
    """

    def __init__(
        self,
        open_port: Callable[[int], Transport],
        baud_rate: int,
        session: Session,
        changed: Notifier,
        latest_sample: LatestSample,
        is_wanted: Callable[[], bool],
    ) -> None:
        self.reconnects = 0
        self.end: WheelwireError | None = None
        """Why the loop ended, once it has."""
        self.lost: LinkLost | None = None
        """Why the port was lost last, if it was."""
        self.opened: SimpleQueue[BaseException | None] = SimpleQueue()
        """Gets None when the port has been opened for the first time, or why it was not."""
        self.search = BaudSearch(None, host_clock_us())
        self.low_latency: bool | None = None
        self.baud_rate: int | None = None
        self.port = ""
        self._first_baud_rate = baud_rate
        self._suspend = SuspendWatch()
        self._check_due_us = 0
        self._answers_before = 0
        self._wrong_board = ""
        self._open_port = open_port
        self._longest_pause_s = FIRST_PAUSE_S
        self._pause_s = 0.0
        """Before the next attempt. No session since the last one: it did not help."""
        self._session = session
        self._changed = changed
        self._latest_sample = latest_sample
        self._is_wanted = is_wanted
        self._calls: deque[tuple[Task, Done]] = deque()
        self._was_open = False
        self._transport: Transport | None = None
        """The port while it is served."""
        self._output = b""
        self._frames: deque[bytes] = deque()
        """Of other threads, for which the port had no room."""
        self._turned_us = 0
        """When the loop last looked at everything."""
        self._coalescing = Coalescing()
        self._due_us = 0
        self._work_pending = True
        """Another thread, or an answer that is under way, may have given the session work."""
        self._finishing = False
        self._begun = threading.Lock()
        """Taken for good, by `run` or by a `finish` that came before it."""
        self._last_stop_until_us: int | None = None
        self._last_stop_done = False
        self._wake_read, self._wake_write = socket.socketpair()
        self._wake_read.setblocking(False)
        self._wake_write.setblocking(False)
        self._poller = select.poll()
        self._poller.register(self._wake_read, select.POLLIN)
        abandon_in_child(self)

    def wake(self) -> None:
        """Make the loop look at the session; from any thread."""
        try:
            self._wake_write.send(b"\0")
        except OSError:  # full: it is awake already; closed: it has ended
            return

    def call(self, task: Task, done: Done) -> None:
        """Have the loop do `task`; from any thread. Never waits.

        `done` is called once, by the loop: by the task, or with the error that it raises, or with
        the loop's end.
        """
        self._calls.append((task, done))
        self.wake()
        if self.end is not None:  # maybe too late for the loop to have seen the call
            self._refuse_calls(self.end)

    def check_room(self) -> None:
        """Raise LinkLost when a setpoint would only wait. Requests have the rest of the room."""
        if len(self._output) + MAX_FRAME * len(self._frames) > OUTPUT_LIMIT // 2:
            raise LinkLost("the port takes nothing that is sent to it; the setpoint was not sent")

    def send(self, frame: bytes, now_us: int) -> None:
        """Write a frame, or leave it to the loop while others wait; from any thread. Never waits.

        A frame of which the port took a part is written again, whole: each begins with a
        delimiter, so that the part costs the frame behind it nothing.

        Raises:
            LinkLost: The port is gone.
        """
        transport = self._transport
        if transport is None:
            raise LinkLost("the port is gone; the setpoint was not sent")
        if self._output or self._frames or transport.write(frame) < len(frame):
            self._frames.append(frame)
            self.wake()
        elif now_us > self._turned_us + REPEAT_AFTER_US:
            self.wake()  # no stream of states does: the frame may have to be repeated
        if self._transport is not transport:
            raise LinkLost("the port was closed; whether the setpoint was sent is not known")

    def finish(self) -> None:
        """Stop the robot, close the port and end; from any thread, even from a finaliser.

        A loop that does not run yet ends here, and never will.
        """
        self._finishing = True
        self.wake()
        if self._begun.acquire(blocking=False):
            self._terminate(LinkClosed(CLOSED))

    def run(self) -> None:
        """The thread's whole life."""
        if not self._begun.acquire(blocking=False):
            return
        end: WheelwireError = LinkClosed(CLOSED)
        try:
            transport = self._open()
            while transport is not None:
                self._connect(transport)
                lost = self._serve(transport)
                transport = None  # its descriptors are freed with it
                if lost:
                    transport = self._reopen()
        except BaseException as error:
            _log.exception("the link's thread failed")
            end = LinkClosed(f"the link's thread failed ({error!r}); open it again")
            end.__cause__ = error
        finally:
            self._terminate(end)

    # --- the port ------------------------------------------------------------------------------

    def _open(self) -> Transport | None:
        """Open the port for the first time; None when that failed.

        Here and not where the link is opened: no signal handler interrupts this thread. An
        exception out of one, before the new descriptor is noted, would leave the port locked.
        """
        try:
            transport = self._open_port(self._first_baud_rate)
        except BaseException as error:
            self.opened.put(error)  # whatever it is: it is raised there
            return None
        self.search = BaudSearch(transport.baud_rate, host_clock_us())
        self._longest_pause_s = transport.longest_pause_s
        self.opened.put(None)
        return transport

    def _serve(self, transport: Transport) -> bool:
        """Serve until the port is lost: True; or until the end: False. Closes the port."""
        self._poller.register(transport)
        self._transport = transport
        try:
            while not (self._is_ending() and self._last_stop_over()):
                self._turn(transport)
        except LinkLost as error:
            self._lose(error)
            return True
        finally:
            self._transport = None
            self._poller.unregister(transport)
            transport.close()
        return False

    def _turn(self, transport: Transport) -> None:
        """Wait, read, do what is due, write."""
        events = self._wait_for_port(transport)
        data = transport.read() if events & select.POLLIN else b""
        # An unplugged port is readable for ever, and nothing comes.
        if events & _BROKEN and not data:
            raise transport.lost()
        self._turned_us = now_us = host_clock_us()
        if self._suspend.slept():
            self._renew(now_us)
        if data:
            self._receive(data, now_us)
        self._do_calls(now_us)
        if self._has_work(now_us):
            self._advance(transport, now_us)
        while self._frames:
            self._output += self._frames.popleft()
        if self._output:
            self._output = self._output[transport.write(self._output) :]

    def _wait_for_port(self, transport: Transport) -> int:
        """Wait until a deadline, a wake-up or the port; returns what the port has to do."""
        now_us, wanted = host_clock_us(), select.POLLIN
        until_us = min(self._due_us, self._repeat_due_us)
        rests = self._may_rest(now_us)
        if rests:
            until_us, wanted = min(until_us, self._coalescing.rest_until_us), 0
        self._poller.modify(transport, wanted | select.POLLOUT if self._output else wanted)
        events = dict(self._poller.poll(max(0.0, (until_us - now_us) / 1000)))
        if self._wake_read.fileno() in events:
            self._drain_wake_ups()
            self._work_pending = True
        found = events.get(transport.fileno(), 0)
        rested = rests and host_clock_us() >= self._coalescing.rest_until_us
        return found | select.POLLIN if rested else found

    def _may_rest(self, now_us: int) -> bool:
        """Nobody misses what the port has before the rest is over."""
        resting = now_us < self._coalescing.rest_until_us
        return resting and not self._work_pending and not self._latest_sample.is_read(now_us)

    # --- the session ---------------------------------------------------------------------------

    def _do_calls(self, now_us: int) -> None:
        while self._calls:
            task, done = self._calls.popleft()
            self._work_pending = True
            try:
                task(done, now_us)
            except WheelwireError as error:
                done(error)
            except Exception as error:
                # Whatever is wrong with one call, the others must still be able to stop the robot.
                _log.exception("a call of the link failed")
                done(WheelwireError(f"the call failed ({error!r}): report this, with the log"))

    def _refuse_calls(self, error: WheelwireError) -> None:
        with suppress(IndexError):
            while True:
                self._calls.popleft()[1](error)

    def _receive(self, data: bytes, now_us: int) -> None:
        self._session.every_state = self._latest_sample.is_iterated
        samples = self._session.receive(data, now_us)
        self._coalescing.note_read(self._session.frames_received, now_us)
        for sample in samples:
            self._latest_sample.put(sample)

    def _has_work(self, now_us: int) -> bool:
        """State frames alone make none, and most reads bring nothing else."""
        return (
            self._work_pending
            or now_us >= min(self._due_us, self._repeat_due_us)
            or self._session.phase is not Phase.OPEN
        )

    @property
    def _repeat_due_us(self) -> int:
        """Asked for each time, not kept: another thread may have sent a setpoint meanwhile."""
        due_us = self._session.setpoint_repeat_due_us
        return self._due_us if due_us is None else due_us

    def _advance(self, transport: Transport, now_us: int) -> None:
        self._check_port(transport, now_us)
        self._search_baud_rate(transport, now_us)
        self._session.advance(now_us)
        self._queue_output()
        due_us = self._session.next_deadline_us
        self._due_us = now_us + IDLE_US if due_us is None else due_us
        self._work_pending = self._session.awaits_answer(now_us)
        self._tell_changes()

    def _queue_output(self) -> None:
        """Queue what the session sends, unless the port has long taken nothing.

        Setpoints among what waits stay: they were taken. Requests are repeated in any case.
        """
        output = self._session.take_output()
        if len(self._output) + len(output) <= OUTPUT_LIMIT:
            self._output += output

    def _drain_wake_ups(self) -> None:
        try:
            self._wake_read.recv(4096)
        except BlockingIOError:
            return

    def _search_baud_rate(self, transport: Transport, now_us: int) -> None:
        rate = self.search.next(now_us)
        if rate is not None:
            transport.set_baud_rate(rate)
            self.baud_rate = transport.baud_rate
        if self.search.over:
            raise _Unanswered("nothing answers at any usual baud rate; opening the port anew")

    def _check_port(self, transport: Transport, now_us: int) -> None:
        """See to it that the port is as it was opened, and leads to whom it led."""
        if now_us >= self._check_due_us:
            self._check_due_us = now_us + CHECK_US
            transport.check()
        session = self._session
        if session.answers > self._answers_before:
            self.search.end(self.baud_rate)
            since_us = session.unanswered_since_us
            if since_us is not None and now_us >= since_us + UNANSWERED_US:
                raise _Unanswered("the device does not answer any more; opening the port anew")
        if session.phase is Phase.HELLO and isinstance(session.error, WrongBoard):
            self._leave_alone(session.error)

    def _leave_alone(self, error: WrongBoard) -> None:
        """Close the port, for it is not the board's that the link was opened to."""
        if error.found != self._wrong_board:
            self._wrong_board = error.found
            _log.warning("%s: %s", self.port, error)
        self._pause_s = WRONG_BOARD_PAUSE_S
        raise error.with_traceback(None)

    def _connect(self, transport: Transport) -> None:
        """The port was opened: say hello."""
        now_us = host_clock_us()
        self.port = transport.port
        self.low_latency = transport.low_latency
        self.baud_rate = transport.baud_rate
        self.search.begin(now_us)
        self._answers_before = self._session.answers
        self._check_due_us = now_us + CHECK_US
        self._session.connect(now_us)
        self._work_pending, self._due_us = True, 0

    def _renew(self, now_us: int) -> None:
        """The computer slept: what is known of the device's clock is wrong."""
        error = LinkLost("the computer was suspended; a new session is being opened")
        self._session.renew(error, now_us)
        self._work_pending, self._due_us = True, 0

    def _lose(self, error: LinkLost) -> None:
        for kept in (error, error.__cause__):
            if kept is not None:  # its traceback would keep the port's descriptors
                kept.__traceback__ = None
        self.lost = None if isinstance(error, _Unanswered) else error
        self._session.disconnect(error)
        self._tell_changes()
        self._output = b""
        self._frames.clear()

    def _reopen(self) -> Transport | None:
        """Try again and again, until the port is there; None when the end has come."""
        while not self._is_ending():
            if self._pause_s:
                self._poller.poll(self._pause_s * 1000)
                self._drain_wake_ups()
                if self._is_ending():
                    break
            self._do_calls(host_clock_us())  # they learn why there is no session
            self._pause_s = min(max(2 * self._pause_s, FIRST_PAUSE_S), self._longest_pause_s)
            try:
                transport = self._open_port(self.search.rate or 0)
            except PortUnavailable:
                continue
            except WheelwireError as error:
                self._session.disconnect(LinkLost(f"{error}; trying again"))
                continue
            self.reconnects += 1
            return transport
        return None

    # --- news and the end ----------------------------------------------------------------------

    def _tell_changes(self) -> None:
        """Notify who waits."""
        is_open = self._session.phase is Phase.OPEN
        if is_open != self._was_open:
            self._was_open = is_open
            if is_open:
                self._pause_s = 0.0
                _log.info("%s: link open", self.port)
            else:
                self._latest_sample.interrupt()
                _log.warning("%s: %s", self.port, self._session.error)
        self._changed.notify_all()

    def _is_ending(self) -> bool:
        return self._finishing or not self._is_wanted()

    def _last_stop_over(self) -> bool:
        """Stop the robot before the end; True when that is done, or in vain."""
        now_us = host_clock_us()
        if self._last_stop_until_us is None:
            self._last_stop_until_us = now_us + STOP_ACK_TIMEOUT_US
            self._session.stop(StopMode.CONFIGURED, self._on_last_stop, now_us)
            self.wake()  # one more turn, to write it
            return False
        done = self._last_stop_done and not self._output
        return done or now_us >= self._last_stop_until_us

    def _on_last_stop(self, _result: Answer | WheelwireError) -> None:
        self._last_stop_done = True

    def fail(self, error: Exception) -> None:
        """End before the beginning: there is no thread to run in."""
        self._terminate(
            LinkClosed(f"the link's thread cannot be started ({error}): close other programs")
        )

    def abandon(self) -> None:
        """This process was forked: its copy of the link ends, the parent's goes on."""
        self._terminate(
            LinkClosed(
                f"this process was forked from the one that opened {self.port}, which keeps it: "
                "close it there and open it here, or fork before it is opened"
            )
        )

    def _terminate(self, end: WheelwireError) -> None:
        self.end = end
        self.opened.put(end)
        self._session.disconnect(end)
        self._refuse_calls(end)
        self._latest_sample.fail(end)
        self._wake_read.close()
        self._wake_write.close()
        self._changed.notify_all()
