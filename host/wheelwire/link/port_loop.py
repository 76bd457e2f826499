"""The loop that owns a port and the session on it.

Requests are queued as calls, which the loop carries out between two reads. So no lock is needed, a
signal handler may make a request whatever it interrupted, and an exception raised by a handler
leaves nothing half done. Only setpoints are written by the calling thread (`send`), one frame in
one system call: waking another thread would take twice as long.
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
"""Between two attempts to open the port; doubled after each attempt."""
STOP_ACK_TIMEOUT_US = 500_000
"""How long `finish` waits for the device to acknowledge the last stop."""
IDLE_US = 1_000_000
"""How long the loop may sleep when nothing is due."""
UNANSWERED_US = 1_000_000
"""Reopen the port when a device that used to answer is silent for this long: it may be at fault."""
CHECK_US = 1_000_000
"""Between two checks of the port's settings."""
WRONG_BOARD_PAUSE_S = 1.0
"""Before trying again: opening may reset that board, and another program may want the port."""
OUTPUT_LIMIT = 4096
"""Bytes queued for the port at most: older ones would be out of date for a robot."""
CLOSED = "the link is closed; open it again"
MAX_FRAME = MAX_ENCODED + 2
_BROKEN = select.POLLHUP | select.POLLERR | select.POLLNVAL

Done: TypeAlias = Callable[[Answer | WheelwireError | None], None]
Task: TypeAlias = Callable[[Done, int], None]
"""Given `done` and the time: hands `done` on, calls it itself, or raises."""

_log = logging.getLogger("wheelwire")


class _Unanswered(LinkLost):
    """The port exists, but is reopened because nothing answers."""


class PortLoop:
    """Serves a session on a port, through every loss of the port, until `finish`.

    Args:
        open_port: Opens the port at a baud rate, or raises the reason; called again whenever the
            port is lost. The loop closes what it returns.
        baud_rate: Tried first.
        session: Not connected yet. Other threads may read it, but not change it.
        changed: Notified when the session opens, ends or fails to open.
        latest_sample: Takes the samples.
        is_wanted: Whether the link is still referenced by anyone who could use or finish it.
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
        """Why the port was last lost, if it was."""
        self.opened: SimpleQueue[BaseException | None] = SimpleQueue()
        """Gets None once the port has been opened for the first time, or the error."""
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
        """Before the next attempt to open the port; grows until a session opens."""
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
        """Setpoints of other threads that did not fit into the port's buffer."""
        self._turned_us = 0
        """When the loop last completed a wait."""
        self._coalescing = Coalescing()
        self._due_us = 0
        self._work_pending = True
        """The session may have work: the loop was woken, or an answer is pending."""
        self._finishing = False
        self._begun = threading.Lock()
        """Acquired once and never released, by `run` or by a `finish` that came before it."""
        self._last_stop_until_us: int | None = None
        self._last_stop_done = False
        self._wake_read, self._wake_write = socket.socketpair()
        self._wake_read.setblocking(False)
        self._wake_write.setblocking(False)
        self._poller = select.poll()
        self._poller.register(self._wake_read, select.POLLIN)
        abandon_in_child(self)

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

    def check_room(self) -> None:
        """Raise LinkLost if a setpoint would only queue up. The other half is kept for requests."""
        if len(self._output) + MAX_FRAME * len(self._frames) > OUTPUT_LIMIT // 2:
            raise LinkLost("the port accepts no data; the setpoint was not sent")

    def send(self, frame: bytes, now_us: int) -> None:
        """Write a frame, or queue it behind others that wait; from any thread. Never waits.

        A frame that the port took only in part is written again as a whole: each frame begins with
        a delimiter, so the fragment does not damage the frame after it.

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
            # No state frames wake the loop, and it may have to repeat this setpoint in time.
            self.wake()
        # The port may have been closed before the write; then the descriptor led nowhere.
        if self._transport is not transport:
            raise LinkLost("the port was closed; whether the setpoint was sent is not known")

    def finish(self) -> None:
        """Stop the robot, close the port and end; from any thread, even from a finaliser.

        A loop that has not started yet ends here, and `run` then returns at once.
        """
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

        In this thread and not the caller's, because no signal handler interrupts this one. An
        exception raised by a handler before the descriptor is stored would leave the port locked.
        """
        try:
            transport = self._open_port(self._first_baud_rate)
        except BaseException as error:
            self.opened.put(error)  # raised in the thread that opens the link
            return None
        self.search = BaudSearch(transport.baud_rate, host_clock_us())
        self._longest_pause_s = transport.longest_pause_s
        self.opened.put(None)
        return transport

    def _serve(self, transport: Transport) -> bool:
        """Serve until the port is lost (True) or the loop ends (False). Closes the port."""
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
        """Wait, read, do what is due, write: one turn of the loop."""
        events = self._wait_for_port(transport)
        data = transport.read() if events & select.POLLIN else b""
        # An unplugged port polls as readable for ever, but gives no data.
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
        """Wait for a deadline, a wake-up or the port; return the port's poll events."""
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
        """Whether reading may be deferred: no answer is pending, and nobody waits for a sample.

        At high state rates one read then takes several frames, which saves wake-ups.
        """
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
                # A bug in one call must not end the loop: others must be able to stop the robot.
                _log.exception("a call of the link failed")
                done(WheelwireError(f"the call failed ({error!r}): report this, with the log"))

    def _refuse_calls(self, error: WheelwireError) -> None:
        with suppress(IndexError):
            while True:
                self._calls.popleft()[1](error)

    def _receive(self, data: bytes, now_us: int) -> None:
        self._session.every_state = self._latest_sample.is_iterated
        measurements = self._session.receive(data, now_us)
        self._coalescing.note_read(self._session.frames_received, now_us)
        for measurement in measurements:
            self._latest_sample.put(measurement)

    def _has_work(self, now_us: int) -> bool:
        """Whether `_advance` is needed: not for state frames, and most reads bring nothing else."""
        return (
            self._work_pending
            or now_us >= min(self._due_us, self._repeat_due_us)
            or self._session.phase is not Phase.OPEN
        )

    @property
    def _repeat_due_us(self) -> int:
        """Queried each time, not cached: another thread may have sent a setpoint meanwhile."""
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
        """Queue the session's output, or drop it if the port has accepted nothing for long.

        Queued setpoints are kept: their caller was told that they are sent. Requests are repeated
        anyway.
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
            raise _Unanswered("nothing answers at any usual baud rate; reopening the port")

    def _check_port(self, transport: Transport, now_us: int) -> None:
        """Check that the port still has its settings and still leads to the same board."""
        if now_us >= self._check_due_us:
            self._check_due_us = now_us + CHECK_US
            transport.check()
        session = self._session
        if session.answers > self._answers_before:
            self.search.end(self.baud_rate)
            since_us = session.unanswered_since_us
            if since_us is not None and now_us >= since_us + UNANSWERED_US:
                raise _Unanswered("the device no longer answers; reopening the port")
        if session.phase is Phase.HELLO and isinstance(session.error, WrongBoard):
            self._leave_alone(session.error)

    def _leave_alone(self, error: WrongBoard) -> None:
        """Close the port: another board is there than the one that the link was opened to."""
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
        """The computer slept, so the estimate of the device's clock is wrong."""
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
        """Retry until the port opens; None when the loop is to end."""
        while not self._is_ending():
            if self._pause_s:
                self._poller.poll(self._pause_s * 1000)
                self._drain_wake_ups()
                if self._is_ending():
                    break
            self._do_calls(host_clock_us())  # they fail with the reason why there is no session
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

    # --- changes and the end -------------------------------------------------------------------

    def _tell_changes(self) -> None:
        """Log a change of the session's state, and notify all waiting threads."""
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
        """Stop the robot before the loop ends; True once acknowledged or timed out."""
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
        """End before the start: the thread could not be created."""
        self._terminate(
            LinkClosed(f"the link's thread cannot be started ({error}): close other programs")
        )

    def abandon(self) -> None:
        """This process was forked: end its copy of the link; the parent's continues."""
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
