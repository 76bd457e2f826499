"""An open link to one device, usable from any thread and any signal handler.

Only the port's thread reads the port and changes the session. A request is handed to that thread,
which calls back with its result; who waits for it has a queue of its own, and waits at most
`CALL_TIMEOUT_S`. A setpoint is written by the calling thread.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, cast

from wheelwire_protocol.codes import StopMode

from ..errors import (
    BoardMismatch,
    DeviceRefused,
    DeviceSilent,
    ForeignDevice,
    LinkLost,
    PortUnavailable,
    ProtocolMismatch,
    RequestTimeout,
    WheelwireError,
)
from .clock import host_clock_us
from .device_link import DeviceLink, Opening, arming
from .info import ExpectedBoard, LinkInfo
from .port_loop import Done, OpenPort, PortLoop, Task
from .requests import Answer, RequestMessage
from .requests import Done as RequestDone
from .sample_stream import LatestSample
from .session import Phase, Session, random_nonce
from .threads import Notifier, holds_ports_up, start_without_waiting
from .traffic import Happening, Listener, StandingNotice, TrafficReader

if TYPE_CHECKING:
    from .shared_thread import SharedThread
    from .sharing import SharingServer
    from .statistics import LinkStatistics
    from .transports import Transport

CONNECT_TIMEOUT_S = 5.0
"""How long to look for the device, unless the application says otherwise."""
PORT_TIMEOUT_S = 60.0
"""A process that moves pins takes up to 28 s to start, an unreachable name server half a minute."""
CLOSE_TIMEOUT_S = 10.0
"""Longer than a port needs to close: a process at the other end brakes for up to 5 s."""


class LinkOptions(NamedTuple):
    """What a link leads to, and how it is opened.

    Attributes:
        port: Device path, pyserial URL, `socket://host:port` or `unix:path`; with `open_port`, a
            name for what that opens.
        baud_rate: Tried first.
        connect_timeout_s: How long to look for the device.
        stream_rate_hz: Rate of the samples; None leaves it to the device.
        watched: Ids of parameters whose values are always available from
            `watched_values`.
        board_id: Accept only this board, at whichever free port it answers; `port` may then be
            glob patterns, separated by commas.
        any_board: Whether to continue with another board than the first, if the port leads to one.
        settings: Parameter id -> the value that the device is given whenever a session opens.
        expected_board: The board that the device has to be on.
        open_port: Opens the transport in place of `port`, at a baud rate or without one; called
            again whenever it was lost, in a thread of its own. It may raise any WheelwireError.
            Any board that it reaches is accepted.
        tap: Whether other programs of this computer may look, stop and e-stop; see `log.share`.
        identity: What these programs find the robot by; empty: by its port.
    """

    port: str
    baud_rate: int = 0
    connect_timeout_s: float = CONNECT_TIMEOUT_S
    stream_rate_hz: int | None = None
    watched: Sequence[int] = ()
    board_id: str | None = None
    any_board: bool = False
    settings: Mapping[int, float] | None = None
    expected_board: ExpectedBoard | None = None
    open_port: OpenPort | None = None
    tap: bool = False
    identity: str = ""


class Link(DeviceLink):
    """A link to one device over a port.

    Args:
        options: What it leads to.
        latest_sample: Takes the samples.

    Attributes:
        changed: Notified when the port or the session opens, ends or fails to open.
    """

    def __init__(self, options: LinkOptions, latest_sample: LatestSample) -> None:
        self.changed = Notifier()
        self._options = options
        self._session = Session(
            random_nonce,
            options.stream_rate_hz,
            options.watched,
            any_board=options.any_board or options.open_port is not None,
            settings=options.settings,
            expected_board=options.expected_board,
        )
        self._sharing_server: SharingServer | None = None
        self._withdrawn: set[RequestDone] = set()
        """Requests whose callers have given up. Each change is one call into C, without a lock."""
        self.reported = self._session.reported
        # Weakly: the port's thread alone must not keep the owner alive.
        this = weakref.ref(self)
        self._loop = PortLoop(
            options.open_port or partial(_open_port, options.port, options.board_id),
            options.baud_rate,
            self._session,
            self.changed,
            latest_sample,
            is_wanted=lambda: this() is not None,
        )
        self._drive_through(self._loop)
        self._thread = threading.Thread(
            target=self._loop.run, name=f"wheelwire {options.port}", daemon=True
        )

    # --- opening and closing -------------------------------------------------------------------

    def open(self) -> None:
        """Open the port and a session.

        Raises:
            PortUnavailable: The port cannot be opened, or the board is at none.
            DeviceSilent: Nothing came.
            ForeignDevice: Bytes came, but no Wheelwire frame.
            ProtocolMismatch: Host and firmware are of different releases.
            DeviceRefused: The device refused the stream rate or a setting.
            RequestTimeout: A Wheelwire device answered, but no session could be opened in time.
        """
        try:
            for ready, timeout_s in self.opening():
                self.changed.wait_for(ready, timeout_s)
        except BaseException:
            # The thread may be running, and would keep the port.
            self.close()
            raise

    def opening(self) -> Opening:
        """As `open`: the caller waits for what this yields, and closes the link on errors."""
        loop = self._loop
        start_without_waiting(self._thread, loop.fail)
        yield lambda: loop.is_opened or loop.end is not None, PORT_TIMEOUT_S
        if loop.failure is not None:
            raise loop.failure.with_traceback(None)
        if not loop.is_opened:
            self._check_alive()
            raise PortUnavailable(
                self._options.port,
                f"opening it takes longer than {PORT_TIMEOUT_S:g} s: plug it in again, or restart "
                "the peer",
            )
        yield self._opening_is_decided, self._options.connect_timeout_s
        if not self._opening_is_decided():
            raise self._why_not_open()
        # Decided does not mean open: a device may have refused for good.
        self.check()
        # A caller looks at the board and its warnings at once. What is lost from here on comes
        # back by itself, as at any later time.
        session = self._session
        yield (
            lambda: session.knows_device or session.phase is not Phase.OPEN or loop.end is not None,
            self._options.connect_timeout_s,
        )
        if self.arms:
            yield from arming(self, session)
        if self._options.tap:
            from .sharing import offer

            self._sharing_server = offer(self)

    def watch(self, parameters: Sequence[int]) -> None:
        """Read the values of these parameters in each session. Call it before `open`."""
        self.reported.watched = tuple(parameters)

    def serve_by(self, thread: SharedThread) -> None:
        """Have `thread` serve the port, along with others. Call it before `open`."""
        self._loop.served_by = thread

    def finish(self) -> None:
        """Begin to stop the robot and close the port, without waiting."""
        self._loop.finish()
        if self._sharing_server is not None:
            self._sharing_server.finish()

    @property
    def _end(self) -> WheelwireError | None:
        return self._loop.end

    def close(self) -> None:
        """Stop the robot, close the port and end the thread. Safe to call more than once."""
        self.finish()
        if threading.current_thread() is self._thread or holds_ports_up():
            return  # called by the garbage collector; the thread ends when it returns to its loop
        # Not join() alone: when a signal handler's exception interrupts it, it may consider the
        # thread ended, so that a second close() would not wait.
        ended = self.changed.wait_for(lambda: self._loop.end is not None, CLOSE_TIMEOUT_S)
        if ended and self._thread.is_alive():  # it may also have ended without a thread
            self._thread.join(CLOSE_TIMEOUT_S)  # it is a daemon in any case
        if self._sharing_server is not None:
            self._sharing_server.close()

    # --- what is known ---------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """The port, for display; while it is being searched for, the pattern or name given."""
        return self._loop.port or self._options.port

    @property
    def identity(self) -> str:
        """The name by which other programs of this computer find the robot."""
        return self._options.identity or self.name

    @property
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""
        loop = self._loop
        return LinkInfo(
            loop.port,
            # Not the port's own rate: during a search that is one of the rates tried.
            loop.policy.search.rate,
            loop.low_latency,
            self._device,
            self.reported.board,
            self.reported.copies_lost,
        )

    @property
    def statistics(self) -> LinkStatistics:
        """What was counted since the link was opened."""
        return self._session.statistics(host_clock_us(), self._loop.policy.reconnects)

    def settle(self) -> None:
        """Wait until the port's thread has noticed a loss, and raise the reason that it knows."""
        if self._session.phase is Phase.OPEN:
            self._result(partial(self._begin, lambda done, _: done(None)))
        else:  # it has noticed
            self._check_alive()
            self._session.check_connected()

    # --- what is answered ----------------------------------------------------------------------

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer; see `DeviceLink.request`."""
        answer: Answer = self._result(partial(self._loop.ask, message, self.post), is_stop=False)
        return answer

    def _remind(self) -> None:
        self._loop.wake_up.wake()

    def post(self, message: RequestMessage, done: RequestDone) -> None:
        """As `request`, without waiting: the link's thread calls `done` with the result."""
        self._begin(lambda done, now_us: self._session.request(message, done, now_us), done)

    def post_stop(self, done: RequestDone, mode: StopMode | None = StopMode.CONFIGURED) -> None:
        """As `stop`, without waiting: the link's thread calls `done` with the result."""
        copy = self._session.setpoints.stop_copy(mode)
        # The port's thread sends the stop that is acknowledged. It has to wake up, and gets the
        # interpreter only when this one releases it: the wheels would turn for milliseconds more.
        if copy is not None:
            with suppress(LinkLost):  # what follows the copy tells
                self._loop.send(copy, host_clock_us())
        self._begin(partial(self._session.stop, mode), done)

    def post_stop_for_attached(self, done: RequestDone) -> None:
        """As `post_stop`, for programs that are attached; see `Session.stop_for_attached`."""
        self._begin(self._session.stop_for_attached, done)

    def withdraw(self, done: RequestDone) -> None:
        """The caller of a request has given up: the link sends no copy of it from now on."""
        self._withdrawn.add(done)  # for a thread that has not begun it; the call below if it has

        def withdraw(answered: Done, _now_us: int) -> None:
            self._session.withdraw(done)
            answered(None)

        self._loop.call(withdraw, lambda _: self._withdrawn.discard(done), is_awaited=False)

    def listen(self, listener: Listener, happening: Happening) -> None:
        """Tell `listener` what happens from now on; of `happening` also what is so already.

        The link's thread calls it.
        """

        def begin(done: Done, _now_us: int) -> None:
            self._loop.listen(listener, happening)
            done(None)

        def answered(result: Answer | WheelwireError | None) -> None:
            # The thread has ended, and nothing else will be reported.
            if isinstance(result, WheelwireError) and happening is Happening.LOST:
                listener(StandingNotice(happening, result))

        self._loop.call(begin, answered, is_awaited=False)

    def listen_to_traffic(self, reader: TrafficReader) -> None:
        """Give `reader` all that crosses the link; call it before `open` or at any time after."""
        if not self._thread.is_alive():
            self._session.listen(reader, host_clock_us())
            return

        def listen(done: Done, now_us: int) -> None:
            self._session.listen(reader, now_us)
            done(None)

        def answered(result: Answer | WheelwireError | None) -> None:
            if isinstance(result, WheelwireError):
                reader.failure = result

        self._loop.call(listen, answered)

    def leave_traffic(self, reader: TrafficReader) -> None:
        """Give `reader` nothing more."""

        def leave(done: Done, _now_us: int) -> None:
            self._session.leave(reader)
            done(None)

        self._loop.call(leave, lambda _: None, is_awaited=False)

    def _begin(self, task: Task, done: RequestDone) -> None:
        """Have the port's thread do `task`, which has `done` called with its result."""
        self._check_alive()
        self._session.check_connected()

        def begin(done: Done, now_us: int) -> None:
            if done not in self._withdrawn:
                task(done, now_us)

        # A request always has a result; None is for tasks that have none.
        self._loop.call(begin, cast("Done", done))

    # --- while it is being opened --------------------------------------------------------------

    def _opening_is_decided(self) -> bool:
        """Whether a session is open, or none can open any more."""
        session = self._session
        # Neither error passes by itself while a link is being opened; any other may.
        final = isinstance(session.error, (ProtocolMismatch, DeviceRefused, BoardMismatch))
        return session.phase is Phase.OPEN or final or self._loop.end is not None

    def _why_not_open(self) -> WheelwireError:
        """Why no session was opened within the connect timeout."""
        session, policy = self._session, self._loop.policy
        port, tried = self._options.port, policy.search.tried
        # A device that answers a hello runs Wheelwire at this rate, even if something else is
        # wrong.
        if session.answers:
            return RequestTimeout(
                f"{port} answers, but no session could be opened in "
                f"{self._options.connect_timeout_s:g} s ({session.error}): allow more time, "
                "and check the cable"
            )
        # A port that was lost without a byte says more than that it was silent.
        if not session.bytes_received and policy.lost is not None:
            return PortUnavailable(port, str(policy.lost))
        # Bytes without an answer: another kind of device, or a rate that was not tried.
        if session.bytes_received:
            text = session.plain_text
            return ForeignDevice(port, tried, session.bytes_received, text.quote, text.sentence)
        return DeviceSilent(port, tried)


def _open_port(port: str, board_id: str | None, baud_rate: int) -> Transport:
    # Here, for not every link needs what they import.
    if board_id is None:
        from .transports import open_transport

        return open_transport(port, baud_rate)
    from .discovery import open_board

    return open_board(port, board_id, baud_rate)
