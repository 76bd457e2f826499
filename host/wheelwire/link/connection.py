"""An open link, usable from any thread and any signal handler.

Only the port's thread reads the port and changes the session. A request is handed to that thread,
and its caller waits for the result on a queue of its own, at most `CALL_TIMEOUT_S`. A setpoint is
written by the calling thread.
"""

from __future__ import annotations

import _thread
import threading
import weakref
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TypeAlias, cast

from wheelwire_protocol.codes import StopMode

from ..errors import LinkLost, WheelwireError
from .base_link import CALL_TIMEOUT_S, CLOSE_TIMEOUT_S, PORT_TIMEOUT_S, BaseLink, LinkOptions
from .clock import host_clock_us
from .latest_sample import LatestSample
from .news import Happening, Listener
from .port_loop import PortLoop
from .requests import Answer, Done, RequestMessage
from .served_port import Done as Told
from .served_port import Task
from .waiting import Notifier

Heard: TypeAlias = Callable[[Answer | WheelwireError], None]


class Link(BaseLink):
    """A link to one device.

    Args:
        options: What it leads to.
        latest_sample: Takes the samples.

    Raises:
        PortUnavailable: The port cannot be opened, or the board is at none.
        DeviceSilent: Nothing came.
        ForeignDevice: Bytes came, but no Wheelwire frame.
        ProtocolMismatch: Host and firmware are of different releases.
        DeviceRefused: The device refused the stream rate or a setting.
        RequestTimeout: A Wheelwire device answered, but no session could be opened in time.
    """

    def __init__(self, options: LinkOptions, latest_sample: LatestSample) -> None:
        self._changed = Notifier()
        session = options.session()
        # Weakly: the port's thread must not keep alive what nobody else refers to any more.
        this = weakref.ref(self)
        self._loop = PortLoop(
            options.opener,
            options.baud_rate,
            session,
            self._changed,
            latest_sample,
            is_wanted=lambda: this() is not None,
        )
        super().__init__(options, session, self._loop)
        self._thread = threading.Thread(
            target=self._loop.run, name=f"wheelwire {options.port}", daemon=True
        )
        try:
            # Thread.start() waits for an Event: an exception out of a signal handler in there can
            # leave the new thread waiting for ever. No handler interrupts a thread but the main.
            try:
                _thread.start_new_thread(_start, (self._thread, self._loop))
            except RuntimeError as error:
                self._loop.fail(error)
            self._wait_for_port()
            self._wait_until_open()
        except BaseException:
            # The thread may be running, and would keep the port.
            self.close()
            raise

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer.

        Raises:
            DeviceRefused: The device refused it.
            LinkLost: The link is down, or went down before the answer came.
            RequestTimeout: No answer came.
        """
        answer = self._call(
            lambda done, now_us: self._session.request(message, done, now_us),
            interrupted=self._session.withdraw,
        )
        return cast("Answer", answer)

    def post(self, message: RequestMessage, done: Heard) -> None:
        """Send a request without waiting; the link's thread calls `done` with the result."""

        def answered(result: Answer | WheelwireError | None) -> None:
            # A request always has a result; None is for tasks that have none.
            if result is not None:
                done(result)

        self._loop.call(lambda done, now_us: self._session.request(message, done, now_us), answered)

    def listen(self, listener: Listener, happening: Happening) -> None:
        """As `BaseLink.listen`; the link's thread calls it."""

        def begin(done: Told, _now_us: int) -> None:
            self._loop.listen(listener, happening)
            done(None)

        def answered(result: Answer | WheelwireError | None) -> None:
            # The thread has ended, and nothing else will be told.
            if isinstance(result, WheelwireError) and happening is Happening.LOST:
                listener((happening, result))

        self._loop.call(begin, answered)

    def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """Stop and wait for the acknowledgement. Without a session it is sent all the same.

        Raises:
            LinkLost: There is no session: whether the stop arrived is unknown.
            RequestTimeout: No acknowledgement came.
        """
        self._write_at_once(self._session.setpoints.stop_copy(mode))
        self._call(lambda done, now_us: self._session.stop(mode, done, now_us))

    def estop(self) -> None:
        """Stop, latch and wait for the acknowledgement; otherwise as `stop`."""
        self._write_at_once(self._session.setpoints.stop_copy(None))
        self._call(self._session.estop)

    def close(self) -> None:
        """Stop the robot, close the port and end the thread. Safe to call more than once."""
        self._loop.finish()
        if threading.current_thread() is self._thread:
            return  # called by the garbage collector; the thread ends when it returns to its loop
        # Not join() alone: when a signal handler's exception interrupts it, it may consider the
        # thread ended, so that a second close() would not wait.
        ended = self._changed.wait_for(lambda: self._loop.end is not None, CLOSE_TIMEOUT_S)
        if ended and self._thread.is_alive():  # it may also have ended without a thread
            self._thread.join(CLOSE_TIMEOUT_S)  # it is a daemon in any case

    def _write(self, frame: bytes, now_us: int) -> None:
        try:
            self._loop.send(frame, now_us)
        except LinkLost:
            # Raise only after the port's thread has noticed: it may know a better reason, and a
            # caller that reads next must get no sample of a link that was reported lost.
            self._call(lambda done, _: done(None))
            raise

    def _write_at_once(self, copy: bytes | None) -> None:
        """Write a stop's copy: the port's thread sends the one that is acknowledged.

        That thread has to be woken, and gets the interpreter only when this one lets go of it:
        milliseconds in which the wheels would turn on.
        """
        if copy is not None:
            with suppress(LinkLost):  # what follows the copy tells
                self._loop.send(copy, host_clock_us())

    def _call(self, task: Task, interrupted: Callable[[Done], None] | None = None) -> Answer | None:
        """Have the port's thread do `task`; return its result, or raise its error.

        When an exception out of a signal handler ends the wait, that thread calls `interrupted`
        with what `task` was given. Without it the task goes on: a stop is to arrive in any case.
        A task whose time is up is withdrawn: nothing of it goes out after its caller has gone on.
        """
        self._check_alive()
        self._session.check_connected()
        # A queue for each call: a result that comes after its caller gave up reaches nobody.
        results: SimpleQueue[Answer | WheelwireError | None] = SimpleQueue()
        # For the call and for its withdrawal, which finds the request by it.
        done = results.put
        overdue = False

        def begin(done: Told, now_us: int) -> None:
            if not overdue:
                task(done, now_us)

        try:
            self._loop.call(begin, done)
            result = results.get(timeout=CALL_TIMEOUT_S)
        except Empty:
            overdue = True  # for a thread that has not begun it; the call below if it has
            self._loop.call(lambda _done, _now_us: self._session.withdraw(done), lambda _: None)
            raise self._call_takes_too_long() from None
        except BaseException:
            if interrupted is not None:
                self._loop.call(lambda _done, _now_us: interrupted(done), lambda _: None)
            raise
        # The same error may end many calls: tracebacks must not pile up in it.
        if isinstance(result, WheelwireError):
            raise result.with_traceback(None)
        return result

    def _wait_for_port(self) -> None:
        """Wait until the link's thread has opened the port; raise the error if it could not."""
        try:
            error = self._loop.opened.get(timeout=PORT_TIMEOUT_S)
        except Empty:
            raise self._port_takes_too_long() from None
        if error is not None:
            try:
                raise error
            finally:
                del error  # its traceback holds this frame

    def _wait_until_open(self) -> None:
        if not self._changed.wait_for(self._opening_is_decided, self._options.connect_timeout_s):
            raise self._why_not_open()
        # Decided does not mean open: a device may have refused for good.
        self.check()


def _start(thread: threading.Thread, loop: PortLoop) -> None:
    try:
        thread.start()
    except RuntimeError as error:
        loop.fail(error)
