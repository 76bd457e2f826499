"""An open link on an asyncio loop, without a thread. Not for use by several threads.

The port is read, and the session changed, by callbacks of the loop. One task opens the port,
reopens it, and ends with the loop: when the loop is shut down it stops the robot first. What may
block is done by the loop's executor: opening a port, and closing one.
"""

from __future__ import annotations

import asyncio
import logging
import select
import weakref
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, TypeVar, cast

from wheelwire_protocol.codes import StopMode

from ..errors import LinkClosed, LinkLost, WheelwireError
from .base_link import CALL_TIMEOUT_S, CLOSE_TIMEOUT_S, PORT_TIMEOUT_S, BaseLink, LinkOptions
from .clock import host_clock_us
from .latest_sample import LatestSample
from .news import Happening, Listener
from .requests import Answer, RequestMessage
from .served_port import CLOSED, Changed, Done, OpenPort, ServedPort, Task
from .session import Session

if TYPE_CHECKING:
    from .transports import Transport

Value = TypeVar("Value")

_log = logging.getLogger("wheelwire")


class Waiters:
    """Coroutines that wait for the link to change."""

    def __init__(self) -> None:
        self._waiting: set[asyncio.Future[None]] = set()

    def notify_all(self) -> None:
        """Have everybody look again."""
        # The coroutines run in a later iteration of the loop, so the set does not change here.
        for waiting in self._waiting:
            _resolve(waiting, None)

    async def wait_for(self, ready: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until `ready()`, or for `timeout_s`; returns whether it was ready."""
        loop = asyncio.get_running_loop()
        end_s = loop.time() + timeout_s
        while not ready():
            if loop.time() >= end_s:
                return False
            waiting = loop.create_future()
            self._waiting.add(waiting)
            # It resolves the same future: when time is up, `ready` is asked once more, too.
            timer = loop.call_at(end_s, _resolve, waiting, None)
            try:
                await waiting
            finally:
                timer.cancel()
                self._waiting.discard(waiting)
        return True


class AsyncPort(ServedPort):
    """Serves a session on a port in the running loop, through every loss, until `finish`.

    Args: those of `ServedPort`. All is to be called in the loop's thread, except `finish`.
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
        self.is_opened = False
        """The port has been opened for the first time."""
        self.failure: BaseException | None = None
        """Why the port could not be opened for the first time."""
        self._loop = asyncio.get_running_loop()
        self._task: asyncio.Task[None] | None = None
        self._over: asyncio.Future[bool] | None = None
        """Done when the port is to be closed; True when it is to be opened again."""
        self._soon: asyncio.Handle | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._poller = select.poll()
        self._attached: int | None = None
        """The descriptor that is waited for."""
        self._reads = self._writes = False
        """What it is waited for."""
        # Last: from then on a fork of the process may call `abandon`, which needs what is above.
        super().__init__(open_port, baud_rate, session, changed, latest_sample, is_wanted)

    def start(self, name: str) -> None:
        """Begin to open the port."""
        self._task = self._loop.create_task(self._run(), name=name)
        self._task.add_done_callback(self._end_if_never_begun)

    def wake(self) -> None:
        """Have a turn soon, in which the session is looked at."""
        self._work_pending = True
        # One turn does for all who ask before it begins.
        if self._soon is None:
            self._soon = self._loop.call_soon(self._step)

    def call(self, task: Task, done: Done) -> None:
        """Do `task` at once, and write what it has to say.

        `done` is called exactly once: by the task, with the error that the task raises, or with the
        reason why the serving ended.
        """
        self._calls.append((task, done))
        # Without a port there are no turns; the session then has the reason for the error.
        if self._transport is None:
            self._do_calls(host_clock_us())
        else:
            self._step()

    def finish(self) -> None:
        """Stop the robot, close the port and end; from any thread, even from a finaliser."""
        self._note_closing()
        # First: the loop's thread may run `_begin_end` before the call below has returned.
        self._finishing = True
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._begin_end)

    async def wait_for_end(self) -> None:
        """Wait until the port is closed. Cancelling this leaves the closing under way."""
        if self._task is not None:
            # To await the task itself would cancel it along with the caller.
            await asyncio.wait([self._task], timeout=CLOSE_TIMEOUT_S)

    def give_up(self, error: LinkLost) -> None:
        """Close the port, and open it again."""
        # A setpoint's write may fail after the port was given up.
        if self._over is None or self._over.done():
            return
        self._detach()
        self._transport = None
        self._lose(error)
        # They came in the turn that found the loss. There is no other turn before the port is back.
        self._do_calls(host_clock_us())
        self._over.set_result(True)

    def abandon(self) -> None:
        """This process was forked: leave the parent's loop and its descriptors alone."""
        # The child shares the loop's epoll with its parent: to remove a reader here would take it
        # from the parent as well.
        self._attached = None
        super().abandon()

    # --- the task ------------------------------------------------------------------------------

    async def _run(self) -> None:
        end = LinkClosed(CLOSED)
        try:
            transport = await self._open()
            while transport is not None:
                lost = await self._serve(transport)
                transport = None  # its descriptors are freed with it
                if lost:
                    transport = await self._reopen()
        except asyncio.CancelledError:
            # While there is a port, `_until` deals with a cancellation.
            _log.debug("%s: ended while there was no port", self.port)
        except Exception as error:
            _log.exception("the link's task failed")
            end = LinkClosed(f"the link's task failed ({error!r}); open it again")
            end.__cause__ = error
        finally:
            self._warn_of_motion()
            self._terminate(end)

    def _end_if_never_begun(self, _task: asyncio.Task[None]) -> None:
        """A task that is cancelled before its first step does nothing, not even its `finally`."""
        if self.end is None:
            self._terminate(LinkClosed(CLOSED))

    async def _open(self) -> Transport | None:
        """Open the port for the first time; None when that failed."""
        try:
            transport = await self._open_in_executor(self._first_baud_rate)
        except Exception as error:
            # The link ends, and `AsyncLink.open` raises this to its caller.
            self.failure = error
            return None
        self._connect(transport)
        self.is_opened = True
        self._changed.notify_all()
        return transport

    async def _reopen(self) -> Transport | None:
        """Retry until the port opens; None when the link is to end."""
        while not self._is_ending():
            await asyncio.sleep(self.policy.take_pause_s())
            try:
                transport = await self._open_in_executor(self.policy.rate)
            except WheelwireError as error:
                self._note_failure(error)
            else:
                self._connect(transport)
                return transport
        return None

    async def _open_in_executor(self, rate: int) -> Transport:
        """Open the port; what is opened after a cancellation is closed at once."""
        opened: deque[Transport] = deque()
        given_up = False

        # The executor's thread stores the port before it looks at `given_up`; the coroutine sets
        # that before it looks for the port. So at least one of them finds it, and `pop` gives it
        # to one alone.
        def open_port() -> None:
            opened.append(self._open_port(rate))
            if given_up:
                close_unclaimed()

        def close_unclaimed() -> None:
            with suppress(IndexError):  # the other thread has done it
                opened.pop().close()

        try:
            await self._loop.run_in_executor(None, open_port)
        except BaseException:
            given_up = True
            if opened:
                self._in_executor(close_unclaimed)
            raise
        return opened.pop()

    async def _serve(self, transport: Transport) -> bool:
        """Serve until the port is lost (True) or the link ends (False). Closes the port."""
        over: asyncio.Future[bool] = self._loop.create_future()
        self._over = over
        self._poller.register(transport)
        self._attached = transport.fileno()
        self._transport = transport
        closing: asyncio.Future[None] | None = None
        # The first turn writes the hello that waits in the session, and has the loop call for more.
        self._step()
        try:
            await self._until(over)
        finally:
            # Also when the loop was closed and this coroutine is thrown away.
            self._detach()
            self._transport = None
            # Before another thread closes it: a closed transport may have no descriptor.
            self._poller.unregister(transport)
            closing = self._in_executor(transport.close)
        # Not within `finally`: a coroutine that is thrown away must not await anything.
        if closing is not None:
            await self._until(closing)
        return over.result()

    async def _until(self, done: asyncio.Future[bool] | asyncio.Future[None]) -> None:
        """Wait for a future. A cancellation, as when the loop ends, stops the robot first."""
        while not done.done():
            try:
                # To await the future itself would cancel it along with this task.
                await asyncio.wait([done])
            except asyncio.CancelledError:  # noqa: PERF203 - it goes on waiting
                # While the port is served, steps send the last stop, and resolve `done` once that
                # is acknowledged or has timed out.
                self._finishing = True
                self._step()

    def _in_executor(self, close: Callable[[], None]) -> asyncio.Future[None] | None:
        """Have the loop's executor close a port; here and now when it has none any more."""
        try:
            return self._loop.run_in_executor(None, close)
        except RuntimeError:
            # The loop is closed, or its executor was shut down.
            close()
            return None

    # --- callbacks of the loop -----------------------------------------------------------------

    def _begin_end(self) -> None:
        if self._transport is not None:
            self._step()
        elif self._task is not None:
            self._task.cancel()  # it opens the port, pauses before it does, or closes it

    def _step(self) -> None:
        """Have a turn, and arrange for the next one."""
        # First: a `wake` during this turn asks for another one.
        self._soon = None
        transport, over = self._transport, self._over
        # The loop may have queued this call before the port was given up.
        if transport is None or over is None or over.done():
            return
        try:
            # Asked anew: the loop does not tell a hang-up from data, and a timer comes without
            # either.
            found = self._poller.poll(0)
            self._turn(transport, found[0][1] if found else 0)
            self._tell_news()
            if self._is_ending() and self._last_stop_over():
                self._detach()
                self._transport = None
                over.set_result(False)
            else:
                self._await_next(transport)
        except LinkLost as error:
            self.give_up(error)
        except Exception as error:
            over.set_exception(error)  # ends the task, which says so

    def _tell_news(self) -> None:
        if self._has_news:
            self._has_news = False
            self._changed.notify_all()

    def _await_next(self, transport: Transport) -> None:
        """Have the loop call `_step` when something comes, can be written, or is due."""
        now_us = host_clock_us()
        until_us, rests = self._next_wait(now_us)
        # During a rest what comes stays in the kernel's buffer, and must not wake the loop.
        if self._reads == rests:
            self._reads = not rests
            if rests:
                self._loop.remove_reader(transport.fileno())
            else:
                self._loop.add_reader(transport.fileno(), self._step)
        # Only while something waits to be written: a port nearly always has room, so the loop would
        # never sleep.
        if self._writes != bool(self._output):
            self._writes = bool(self._output)
            if self._writes:
                self._loop.add_writer(transport.fileno(), self._step)
            else:
                self._loop.remove_writer(transport.fileno())
        # A deadline that has moved on leaves the timer as it is, for most turns move it: at worst a
        # turn is had for nothing.
        due_s = self._loop.time() + max(0, until_us - now_us) / 1e6
        if self._timer is None or self._timer.when() > due_s:  # an early one does no harm
            if self._timer is not None:
                self._timer.cancel()
            self._timer = self._loop.call_at(due_s, self._on_time)

    def _on_time(self) -> None:
        self._timer = None
        self._step()

    def _detach(self) -> None:
        """The loop is not to call `_step` any more."""
        for handle in (self._timer, self._soon):
            if handle is not None:
                handle.cancel()
        self._timer = self._soon = None
        descriptor, self._attached = self._attached, None
        # A closed loop watches nothing any more, and raises when it is told to stop.
        if descriptor is None or self._loop.is_closed():
            return
        if self._reads:
            self._loop.remove_reader(descriptor)
        if self._writes:
            self._loop.remove_writer(descriptor)
        self._reads = self._writes = False


class AsyncLink(BaseLink):
    """A link to one device on the running loop. Is to be opened first, and closed.

    Args:
        options: What it leads to.
        latest_sample: Takes the samples.
    """

    def __init__(self, options: LinkOptions, latest_sample: LatestSample) -> None:
        self.changed = Waiters()
        """Notified of samples and of changes of the session."""
        session = options.session()
        # Weakly: the task of the port must not keep alive what nobody else refers to any more.
        this = weakref.ref(self)
        self._port = AsyncPort(
            options.opener,
            options.baud_rate,
            session,
            self.changed,
            latest_sample,
            is_wanted=lambda: this() is not None,
        )
        super().__init__(options, session, self._port)
        # Not a method of this object: the finaliser of its owner keeps it.
        self.finish = self._port.finish
        """Begin to stop the robot and close the port, without waiting; from any thread."""

    @property
    def has_ended(self) -> bool:
        """The link is down for good."""
        return self._port.end is not None

    async def open(self) -> None:
        """Open the port and a session.

        Raises:
            WheelwireError: As `Link`.
        """
        self._port.start(f"wheelwire {self._options.port}")
        try:
            await self._wait_for_port()
            await self._wait_until_open()
        except BaseException:
            # A cancellation, too: the task would go on serving a port that nobody can close.
            await self.close()
            raise

    async def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer.

        Raises:
            DeviceRefused: The device refused it.
            LinkLost: The link is down, or went down before the answer came.
            RequestTimeout: No answer came.
        """
        answer = await self._call(lambda done, now_us: self._session.request(message, done, now_us))
        return cast("Answer", answer)

    def post(self, message: RequestMessage) -> None:
        """Send a request without waiting for the answer."""
        self._check_alive()
        self._port.call(
            lambda done, now_us: self._session.request(message, done, now_us), lambda _: None
        )

    def listen(self, listener: Listener, happening: Happening) -> None:
        """As `BaseLink.listen`; called in the loop."""
        self._port.listen(listener, happening)

    async def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """Stop and wait for the acknowledgement. Without a session it is sent all the same.

        Raises:
            LinkLost: There is no session: whether the stop arrived is unknown.
            RequestTimeout: No acknowledgement came.
        """
        await self._call(lambda done, now_us: self._session.stop(mode, done, now_us))

    async def estop(self) -> None:
        """Stop, latch and wait for the acknowledgement; otherwise as `stop`."""
        await self._call(self._session.estop)

    async def close(self) -> None:
        """Stop the robot and close the port. Safe to call more than once.

        When it is cancelled the port is closed all the same, a moment later.
        """
        if self.has_ended:
            return
        self.finish()
        await self._port.wait_for_end()

    async def _wait_for_port(self) -> None:
        port = self._port
        done = await self.changed.wait_for(lambda: port.is_opened or self.has_ended, PORT_TIMEOUT_S)
        if not done:
            raise self._port_takes_too_long()
        if port.failure is not None:
            raise port.failure.with_traceback(None)

    async def _wait_until_open(self) -> None:
        timeout_s = self._options.connect_timeout_s
        if not await self.changed.wait_for(self._opening_is_decided, timeout_s):
            raise self._why_not_open()
        # Decided does not mean open: a device may have refused for good.
        self.check()

    def _write(self, frame: bytes, now_us: int) -> None:
        try:
            self._port.send(frame, now_us)
        except LinkLost as error:
            # The write may be the first to find out; whoever asks next must see the loss, too.
            self._port.give_up(error)
            raise

    async def _call(self, task: Task) -> Answer | None:
        """Do `task` at once; wait for its result, return it or raise it."""
        self._check_alive()
        self._session.check_connected()
        answered: asyncio.Future[Answer | WheelwireError | None] = (
            asyncio.get_running_loop().create_future()
        )

        def done(result: Answer | WheelwireError | None) -> None:
            _resolve(answered, result)

        # `done` may be called in here, before anybody waits.
        self._port.call(task, done)
        overdue = self._call_takes_too_long()
        timer = answered.get_loop().call_later(CALL_TIMEOUT_S, _resolve, answered, overdue)
        try:
            result = await answered
        except asyncio.CancelledError:
            # A late copy would be carried out after whatever the program does next.
            self._session.withdraw(done)
            raise
        finally:
            timer.cancel()
        if result is overdue:
            self._session.withdraw(done)
        # The same error may end many calls: tracebacks must not pile up in it.
        if isinstance(result, WheelwireError):
            raise result.with_traceback(None)
        return result


def _resolve(future: asyncio.Future[Value], value: Value) -> None:
    """End the waiting for a future, if anybody still waits."""
    if not future.done():
        with suppress(RuntimeError):  # the loop is closed
            future.set_result(value)
