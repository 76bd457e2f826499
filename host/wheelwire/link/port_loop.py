"""The thread that serves a port and its session.

It waits for the port, reads, does what is due, writes, and reopens the port when it is lost. For
several links of an asyncio loop, one thread does all this except opening: see `shared_thread`.
Other threads hand requests to it as calls, which it makes between two reads. So no lock is needed,
a signal handler may make a request at any point, and an exception that a handler raises leaves
nothing half done. The calling thread itself writes setpoints, and requests that need not queue, one
frame in one system call: waking another thread would take twice as long.
"""

from __future__ import annotations

import select
import threading
from collections import deque
from collections.abc import Callable
from contextlib import ExitStack
from time import monotonic_ns
from typing import TYPE_CHECKING, TypeAlias, cast

from wheelwire_protocol.framing import MAX_ENCODED

from ..errors import LinkClosed, LinkLost, WheelwireError
from . import LINK_LOG, LOG
from .clock import SuspendWatch, host_clock_us
from .port_policy import Coalescing, LastStop, PortPolicy
from .requests import Answer, RequestMessage
from .requests import Done as RequestDone
from .sample_stream import LatestSample
from .session import Phase, Session
from .setpoints import REPEAT_AFTER_US
from .threads import Notifier, WakeUp, abandon_in_child
from .traffic import Happening, Kind, Listener, Reporter

if TYPE_CHECKING:
    from .shared_thread import SharedThread
    from .transports import Transport

IDLE_US = 1_000_000
"""The longest wait when nothing is due."""
OUTPUT_LIMIT = 4096
"""The most bytes that are queued for the port: older ones would be out of date for a robot."""
CLOSED = "the link is closed; open it again"
# With a delimiter at either end.
MAX_FRAME = MAX_ENCODED + 2
# `poll` always reports these, so also during a rest.
BROKEN = select.POLLHUP | select.POLLERR | select.POLLNVAL

OpenPort: TypeAlias = "Callable[[int], Transport]"
"""Opens the port at a baud rate, or raises a WheelwireError."""
Done: TypeAlias = Callable[[Answer | WheelwireError | None], None]
Task: TypeAlias = Callable[[Done, int], None]
"""Gets `done` and the time. It passes `done` on, calls it, or raises."""
Post: TypeAlias = Callable[[RequestMessage, RequestDone], None]


class PortLoop(Reporter):
    """Serves a session on a port, through every loss of the port, until `finish`.

    `call`, `send` and `finish` may be called by any thread, and by a signal handler.

    Args:
        open_port: Opens the port; called again whenever it is lost. What it returns is closed here.
        baud_rate: Tried first.
        session: Not connected yet. Other threads may read it, but not change it.
        changed: Notified when the port or the session opens, ends or fails to open.
        latest_sample: Takes the samples.
        is_wanted: Whether the link is still referenced by anyone who could use or finish it.
    """

    def __init__(
        self,
        open_port: OpenPort,
        baud_rate: int,
        session: Session,
        changed: Notifier,
        latest_sample: LatestSample,
        is_wanted: Callable[[], bool],
    ) -> None:
        self.end: WheelwireError | None = None
        """Why the serving ended, once it has."""
        self.is_opened = False
        """The port has been opened for the first time."""
        self.failure: BaseException | None = None
        """Why the port could not be opened for the first time."""
        self.policy = PortPolicy(host_clock_us())
        self.low_latency: bool | None = None
        self.baud_rate: int | None = None
        self.port = ""
        self.served_by: SharedThread | None = None
        """Serves the port while it is open; None: the link's own thread does. Set before `run`."""
        self.clock_ns = monotonic_ns
        self._first_baud_rate = baud_rate
        self._suspend = SuspendWatch()
        self._open_port = open_port
        self._session = session
        self._changed = changed
        self._latest_sample = latest_sample
        self._is_wanted = is_wanted
        # A deque: any thread may use either of its ends without a lock.
        self._calls: deque[tuple[Task, Done, bool]] = deque()
        """With whether somebody waits for the result."""
        self._was_open = False
        self._transport: Transport | None = None
        """The port while it is served."""
        # Bytes, replaced as a whole: other threads look at it without a lock.
        self.output = b""
        """What waits for the port."""
        self.frames: deque[bytes] = deque()
        """Setpoints that did not fit into the port's buffer."""
        self._turned_us = 0
        """When the last pass began."""
        self._coalescing = Coalescing()
        self._rest_until_us = 0
        """The end of the present rest."""
        self._has_sample = False
        """Whether a sample is stored for which no waiter was woken yet."""
        self._due_us = 0
        self._wait_due_us = 0
        """When the loop has work although nothing comes, by the newest `_next_wait`."""
        self._work_pending = True
        """The session may have work: somebody woke the loop, or an answer is pending."""
        self._finishing = False
        self._last_stop = LastStop()
        self._closing_us: int | None = None
        """When the closing began."""
        self._begun = threading.Lock()
        """Acquired once and never released, by `run` or by a `finish` that came before it."""
        self.wake_up = WakeUp()
        """Makes the loop check the session; to be polled along with the port."""
        self._poller = select.poll()
        self._poller.register(self.wake_up, select.POLLIN)
        self.wanted = select.POLLIN
        """The port's events to poll for, by the newest `next_wait`; without POLLIN it rests."""
        # Last: from here on a fork calls `abandon`, which needs all of the above.
        abandon_in_child(self)

    def call(self, task: Task, done: Done, *, is_awaited: bool = True) -> None:
        """Have the loop do `task`; from any thread. Never waits.

        `done` is called exactly once: by the task, with the error that the task raises, or with the
        reason why the loop ended. If nobody waits for it, an error of the task ends the link, which
        tells everybody.
        """
        self._calls.append((task, done, is_awaited))
        self.wake_up.wake()
        if self.end is not None:  # the loop may have ended before it saw the call
            self._refuse_calls(self.end)

    def ask(self, message: RequestMessage, post: Post, done: RequestDone) -> None:
        """Write a request in the calling thread; if that has to hand it over, as `post` does.

        The port's thread waits for bytes anyway, so this need not wake it. If the answer is late,
        the caller that waits for `done` calls `wake_up.wake`, and the thread repeats the request.
        """
        transport = self._transport
        # What was handed over before comes first.
        if transport is None or self._calls or self.output or self.frames:
            post(message, done)
            return
        now_us = monotonic_ns() // 1000
        claimed = self._session.claim_request(message, done, now_us)
        if claimed is None:
            post(message, done)
            return
        if not claimed.frame:
            # As in `_begin` of the link: its result is an answer or an error.
            self.call(
                lambda done, now_us: self._session.request_claimed(claimed, done, now_us),
                cast("Done", done),
            )
            return
        # What the port does not take is repeated like what is lost behind it, and a loss of the
        # port ends the request.
        try:  # not `suppress`, which is three calls of Python
            transport.write(claimed.frame)
        except LinkLost:
            return
        if not self.wanted & select.POLLIN:  # it rests
            self.wake_up.wake()

    def finish(self) -> None:
        """Stop the robot, close the port and end; from any thread, even from a finaliser.

        A loop that has not started yet ends here, and `run` then returns at once.
        """
        self._note_closing()
        # First: the loop looks at it as soon as it is woken.
        self._finishing = True
        self.wake_up.wake()
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
            # Reported to all waiting threads: otherwise they would learn only that time ran out.
            LOG.exception("the link's thread failed")
            end = LinkClosed(f"the link's thread failed ({error!r}); open it again")
            end.__cause__ = error
        finally:
            self._warn_of_motion()
            self._terminate(end)

    def fail(self, error: Exception) -> None:
        """End the link before its start: the thread could not be created."""
        self._terminate(
            LinkClosed(f"the link's thread cannot be started ({error}): close other programs")
        )

    def check_room(self) -> None:
        """Raise LinkLost if a setpoint would only queue up; requests have the other half."""
        # An upper bound: their sum would iterate over what another thread may be changing.
        if len(self.output) + MAX_FRAME * len(self.frames) > OUTPUT_LIMIT // 2:
            raise LinkLost(
                "the port accepts no data, so the setpoint was not sent: check what is at its "
                "other end"
            )

    def send(self, frame: bytes, now_us: int) -> None:
        """Write a frame, or queue it behind others that wait; from any thread. Never waits.

        A frame that the port took only in part is written again as a whole: each frame begins with
        a delimiter, so the fragment does not damage the frame after it.

        Raises:
            LinkLost: The port is gone.
        """
        transport = self._transport
        if transport is None:
            raise LinkLost(
                "the port is gone, so the setpoint was not sent: send the next one when the "
                "robot is back"
            )
        # Behind what waits, or a newer setpoint would overtake an older one.
        waits = bool(self.output or self.frames)
        if not waits:
            is_read = self._session.traffic.readers  # `_put` is for them
            written = self._put(transport, frame) if is_read else transport.write(frame)
            waits = written < len(frame)
        if waits:
            self.frames.append(frame)
            self.wake_up.wake()
        else:
            # This setpoint may have to be repeated, for which no state may cause a turn in time:
            # the next one is expected later, or the stream has ended.
            next_us, turned_us = self._coalescing.next_us, self._turned_us
            if (
                next_us > now_us + REPEAT_AFTER_US
                or now_us > min(next_us, turned_us) + REPEAT_AFTER_US
            ):
                self.wake_up.wake()
        # The port may have been closed before the write; then the descriptor led nowhere.
        if self._transport is not transport:
            raise LinkLost(
                "the port was closed, and the setpoint may not have been sent: send the next "
                "one when the robot is back"
            )

    def abandon(self) -> None:
        """End this forked process's copy of the link; the parent's link continues."""
        self._terminate(
            LinkClosed(
                f"this process was forked from the one that opened {self.port}, which keeps it: "
                "close it there and open it here, or fork before it is opened"
            )
        )

    # --- opening and serving ------------------------------------------------------------------

    def _open(self) -> Transport | None:
        """Open the port for the first time; None when that failed.

        In this thread and not the caller's, because no signal handler interrupts this one. An
        exception raised by a handler before the descriptor is stored would leave the port locked.
        """
        try:
            transport = self._open_port(self._first_baud_rate)
        except BaseException as error:
            self.failure = error  # raised where the link is opened
            return None
        self._connect(transport)
        self.is_opened = True
        self._changed.notify_all()
        return transport

    def _reopen(self) -> Transport | None:
        """Retry until the port opens; None when the loop has to end."""
        while not self._is_ending():
            self._pause(self.policy.take_pause_s())
            # It may have been `finish` that ended the pause.
            if self._is_ending():
                break
            try:
                transport = self._open_port(self.policy.rate)
            except WheelwireError as error:
                failure = self.policy.error_of_failure(error)
                if failure is not None:
                    self._session.disconnect(failure)
            else:
                self._connect(transport)
                return transport
        return None

    def _pause(self, pause_s: float) -> None:
        """Wait for this time, or until the loop has to end.

        Calls wake it, and fail with the reason why there is no session. They do not shorten the
        pause, because opening a port may reset its board.
        """
        end_us = host_clock_us() + round(pause_s * 1e6)
        while True:
            now_us = host_clock_us()
            self._do_calls(now_us)
            if now_us >= end_us or self._is_ending():
                return
            # Only for wake-ups: the lost port is not registered any more.
            self._poller.poll((end_us - now_us) / 1000)
            self.wake_up.drain()

    def _serve(self, transport: Transport) -> bool:
        """Serve until the port is lost (True) or the loop ends (False). Closes the port."""
        self._transport = transport
        try:
            if self.served_by is not None:
                self.served_by.serve(self, transport)
            else:
                self._serve_here(transport)
        except LinkLost as error:
            self._lose(error)
            return True
        finally:
            # First, so that no other thread begins a write to a port that is being closed.
            self._transport = None
            transport.close()
            # A sample may have come in the turn that ended the serving.
            self.wake_readers()
        return False

    def _serve_here(self, transport: Transport) -> None:
        descriptor, poller = transport.fileno(), self._poller
        polled = select.POLLIN
        poller.register(descriptor, polled)
        try:
            while not (self._finishing and self.is_over()):
                now_us = monotonic_ns() // 1000  # as `host_clock_us`, without the call
                until_us = self.next_wait(now_us)
                if self.wanted != polled:
                    polled = self.wanted
                    poller.modify(descriptor, polled)
                if self._has_sample and self._latest_sample.changed.waiting:
                    self.wake_readers()
                events = 0
                for ready, found in poller.poll(max(0.0, (until_us - now_us) / 1000)):
                    if ready == descriptor:
                        events = found
                    else:
                        self.take_wake_up()
                self.turn(transport, events)
        finally:
            poller.unregister(descriptor)

    # --- one turn, in whichever thread serves the port -------------------------------------------

    def take_wake_up(self) -> None:
        """`wake_up` is readable: the next turn checks the session."""
        self.wake_up.drain()
        self._work_pending = True

    def is_over(self) -> bool:
        """Whether the link was finished and its last stop is over: the port is to be closed."""
        return self._finishing and self._last_stop_over()

    def next_wait(self, now_us: int) -> int:
        """The time [us] until which to wait for the port's `wanted` events, or a wake-up."""
        until_us = self._due_us
        # Asked for at each turn: another thread may have sent a setpoint.
        unseen = self._session.setpoints.unseen
        if unseen is not None and unseen[2] < until_us:
            until_us = unseen[2]
        # Without the rest: at its end there is something to read, but nothing is due.
        self._wait_due_us = until_us
        rest_until_us, latest = self._coalescing.idle_until_us, self._latest_sample
        if latest.changed.waiting or latest.iterators:
            rest_until_us = 0  # as `_longest_rest`, without the call
        elif now_us < rest_until_us:
            self._rest_until_us = rest_until_us = self._longest_rest(now_us)
        rests = now_us < rest_until_us
        if rests:
            # First: a thread that puts a request on the line after the next look finds it so.
            self.wanted = 0
            rests = not self._session.is_asked
        self.wanted = (0 if rests else select.POLLIN) | (select.POLLOUT if self.output else 0)
        return min(until_us, rest_until_us) if rests else until_us

    def turn(self, transport: Transport, events: int) -> None:
        """Read, do what is due, write.

        At 100 frames a second each pass finds cold caches, and calling a function costs more than
        what it does: nothing is called here that nearly no pass needs.

        Args:
            transport: The port.
            events: Of the port, as `poll` gives them.

        Raises:
            LinkLost: The port is to be closed, and opened again.
        """
        data = transport.read() if events & select.POLLIN or self._rest_is_over() else b""
        # An unplugged port polls as readable for ever, but gives no data.
        if events & BROKEN and not data:
            raise transport.lost()
        # Not before the read: an arrival dated too early would break the bound of the clock.
        self._turned_us = now_us = monotonic_ns() // 1000
        suspend = self._suspend
        # Before what came is stamped by a wrong estimate.
        ahead_us = suspend.boot_clock_ns() // 1000 - now_us
        if ahead_us > suspend.limit_us and suspend.was_suspended(now_us):
            self._renew(now_us)
        if data:
            session, latest = self._session, self._latest_sample
            # Asked at each read: iterators come and go.
            measured = session.receive(data, now_us, every_state=bool(latest.iterators))
            for measurement in measured:
                latest.put(measurement)
                self._has_sample = True
            sensors = session.reported.sensors_if_asked
            has_sensed = False
            if sensors is not None and sensors.sensed:
                latest.sensors.take(self.port, sensors.sensed)
                has_sensed = self._has_sample = True
            self._coalescing.note_read(
                session.frames_received, now_us, has_state=bool(measured), has_sensed=has_sensed
            )
        if self._calls:
            self._do_calls(now_us)
        # A setpoint sent since the wait began is to be repeated later than now, or has woken this.
        if (
            self._work_pending
            or now_us >= self._wait_due_us
            or self._session.phase is not Phase.OPEN
        ):  # most reads bring state frames only, which need nothing here
            self._advance(transport, now_us)
        if self._session.notices:
            self._tell_listener()
        if self.frames or self.output:
            self._write(transport)

    def _rest_is_over(self) -> bool:
        """Whether data has to be read without being asked for: the rest did not poll for it."""
        return not self.wanted & select.POLLIN and host_clock_us() >= self._rest_until_us

    def _longest_rest(self, now_us: int) -> int:
        """Until when reading may be deferred; 0: an answer is pending, or a sample is awaited.

        At high state rates one read then takes several frames, which saves wake-ups.
        """
        latest = self._latest_sample
        if self._work_pending or latest.sensors.is_iterated:
            return 0
        coalescing = self._coalescing
        if latest.is_read(now_us):
            return coalescing.short_rest_until_us
        is_idle = (
            now_us > self._session.setpoints.moves_until_us
            and self._listener is None
            and not self._session.traffic.readers
        )
        return coalescing.idle_until_us if is_idle else coalescing.rest_until_us

    def _do_calls(self, now_us: int) -> None:
        while self._calls:
            # It stays there until it is done: see `ask`.
            task, done, is_awaited = self._calls[0]
            # What it has the session say is sent by `_advance`, in this same turn.
            self._work_pending = True
            try:
                task(done, now_us)
            except Exception as error:
                if not is_awaited:
                    raise RuntimeError(f"a call of the link failed: {error!r}") from error
                if not isinstance(error, WheelwireError):
                    # A bug in one call must not end the loop: others must be able to stop the
                    # robot.
                    LOG.exception("a call of the link failed")
                    why = f"the call failed ({error!r}): report this, with the log"
                    error = WheelwireError(why)
                done(error)
            finally:
                self._calls.popleft()

    def _refuse_calls(self, error: WheelwireError) -> None:
        with ExitStack() as refusals:  # each is refused, though refusing one of them fails
            while self._calls:
                try:  # another thread may be taking calls out as well
                    _, done, _ = self._calls.pop()
                except IndexError:
                    return
                refusals.callback(done, error)

    def wake_readers(self) -> None:
        """Wake all that wait for a sample. Called right before the loop waits.

        Earlier, the thread that is woken would compete with this one for the interpreter.
        """
        if not self._has_sample:
            return
        self._has_sample = False
        # A thread that begins to wait after this check finds the sample.
        if self._latest_sample.changed.waiting:
            self._latest_sample.notify_all()

    def _advance(self, transport: Transport, now_us: int) -> None:
        if not self._is_wanted():  # its owner was garbage-collected without close()
            self._finishing = True
        # Before the session sends anything: this finds out whether the port is to be given up.
        self._check_port(transport, now_us)
        self._session.advance(now_us)
        self._queue_output()
        if self.output:
            self._write(transport)  # before the rest: the round trip of a ping has begun
        due_us = self._session.next_deadline_us
        self._due_us = now_us + IDLE_US if due_us is None else due_us
        # While an answer is awaited each pass looks at the session, and the port does not rest.
        self._work_pending = self._session.awaits_answer(now_us)
        self._tell_changes()

    def _write(self, transport: Transport) -> None:
        """Write what the port takes."""
        while self.frames:  # other threads append at any time
            self.output += self.frames.popleft()
        if self.output:
            self.output = self.output[self._put(transport, self.output) :]

    def _put(self, transport: Transport, data: bytes) -> int:
        """Write what the port takes of `data`; returns how much that was."""
        written = transport.write(data)
        traffic = self._session.traffic
        if traffic.readers and written:
            traffic.put(Kind.SENT, host_clock_us(), data[:written])
        return written

    def _queue_output(self) -> None:
        """Queue as much of the session's output as fits; the port may accept nothing for long.

        Queued setpoints stay: their caller was promised that they are sent. Requests are repeated
        anyway.
        """
        if not self._session.output:
            return
        output = self._session.take_output()
        room = OUTPUT_LIMIT - len(self.output)
        if len(output) > room:  # whole frames alone: between two of them are two delimiters
            output = output[: output.rfind(b"\0\0", 0, room + 1) + 1]
        self.output += output

    # --- the port ------------------------------------------------------------------------------

    def _check_port(self, transport: Transport, now_us: int) -> None:
        """Check that the port still has its settings, leads to the same board, and is answered."""
        policy = self.policy
        if policy.takes_check(now_us):
            transport.check()
        # The rate of this session is known and its frames were judged: nothing is left to do.
        if self._was_open and self._session.phase is Phase.OPEN:
            return
        policy.judge(self._session, self.baud_rate, now_us)
        rate = policy.next_rate(now_us)
        if rate is not None:
            transport.set_baud_rate(rate)
            # Not `rate`: an adapter that cannot have it keeps its own.
            self.baud_rate = transport.baud_rate

    def _connect(self, transport: Transport) -> None:
        """Begin a session on a port that was just opened."""
        now_us = host_clock_us()
        self.port = transport.port
        self.low_latency = transport.low_latency
        self.baud_rate = transport.baud_rate
        self.policy.begin(transport.baud_rate, transport.longest_pause_s, self._session, now_us)
        self._session.connect(now_us)
        # A caller may have queued one for the previous port after it was lost, and got an error.
        self.frames.clear()
        # A pass at once: the hello waits in the session.
        self._work_pending, self._due_us = True, 0

    def _renew(self, now_us: int) -> None:
        """The computer slept, so the estimate of the device's clock is wrong."""
        error = LinkLost(
            "the computer was suspended; a new session is being opened", causes=("host_frozen",)
        )
        self._session.renew(error, now_us)
        self._work_pending, self._due_us = True, 0

    def _lose(self, error: LinkLost) -> None:
        """Give the port up because of `error`."""
        for kept in (error, error.__cause__):
            if kept is not None:  # its traceback would keep the port's descriptors
                kept.__traceback__ = None
        if self.policy.note_lost(error):
            LINK_LOG.warning("%s: %s", self.port, error)
        # First: a thread that sees the link lost must get no earlier sample.
        self._latest_sample.interrupt()
        self._session.disconnect(error)
        self._tell_changes()
        self.output = b""
        self.frames.clear()

    # --- changes and the end -------------------------------------------------------------------

    def _tell_changes(self) -> None:
        """Log a change of the session's state, and notify all who wait."""
        is_open = self._session.phase is Phase.OPEN
        if is_open != self._was_open:
            self._was_open = is_open
            if is_open:
                self.policy.session_opened()
                LINK_LOG.info("%s: link open", self.port)
            else:
                self._latest_sample.interrupt()
                LINK_LOG.warning("%s: %s", self.port, self._session.error)
        self._tell_listener()  # samples of a lost link are gone by now
        # Even if it did not change: a thread that opens a link also waits for a final error.
        self._changed.notify_all()

    def listen(self, listener: Listener, happening: Happening) -> None:
        """Report what happens from now on, and of `happening` also what is so already.

        The loop calls it as a task.
        """
        self._tell_listener()  # of what was before
        super().listen(listener, happening)

    def _is_ending(self) -> bool:
        return self._finishing or not self._is_wanted()

    def _last_stop_over(self) -> bool:
        """Stop the robot before the port is closed; True once acknowledged or timed out."""
        now_us = host_clock_us()
        self._note_closing()
        if not self._last_stop.begun:
            self._last_stop.begin(self._session, now_us)
            self.wake_up.wake()  # one more turn, to write it
            return False
        return self._last_stop.is_over(now_us, all_written=not self.output)

    def _note_closing(self) -> None:
        """Begin to close: whether the robot moves is decided at this moment."""
        if self._closing_us is None:
            self._closing_us = host_clock_us()

    def _warn_of_motion(self) -> None:
        """Log a warning if the robot drove when the closing began, and has acknowledged no stop."""
        left_us = self._session.setpoints.moves_until_us - (self._closing_us or host_clock_us())
        if left_us > 0:
            LINK_LOG.warning(
                "%s: closed while the robot drives and cannot be reached: it stops by itself when "
                "its last setpoint expires, within %.1f s",
                self.port,
                left_us / 1e6,
            )

    def _terminate(self, end: WheelwireError) -> None:
        # First: later calls are refused because of it, and the threads woken below read it.
        self.end = end
        with ExitStack() as last:  # all of it happens, in the opposite order, though a part fails
            # Last: threads that wait for the end find everything released.
            last.callback(self._changed.notify_all)
            last.callback(self.wake_up.close)
            last.callback(self._tell_listener)
            last.callback(self._latest_sample.fail, end)
            last.callback(self._refuse_calls, end)
            self._session.disconnect(end)
