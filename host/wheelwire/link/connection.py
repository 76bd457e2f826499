"""An open link, usable from any thread and any signal handler.

Only the port's thread reads the port and changes the session. A request is handed to that thread,
and its caller waits for the result on a queue of its own, at most `CALL_TIMEOUT_S`. A setpoint is
written by the calling thread.
"""

from __future__ import annotations

import _thread
import os
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from queue import Empty, SimpleQueue
from typing import cast

from wheelwire_protocol.codes import StopMode

from ..errors import (
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
from .discovery import open_board
from .info import DeviceInfo, LinkStatistics
from .latest_sample import LatestSample
from .port_loop import PortLoop
from .requests import Answer, RequestMessage
from .served_port import OpenPort, Task
from .session import Phase, Session
from .transports import Transport, open_transport
from .waiting import Notifier

Heard = Callable[[Answer | WheelwireError], None]

JOIN_S = 10.0
"""Longer than the port's thread needs to end: a process at the other end brakes for up to 5 s. The
thread is a daemon in any case."""
PORT_TIMEOUT_S = 60.0
"""A process that moves pins takes up to 28 s to start, an unreachable name server half a minute."""
CALL_TIMEOUT_S = 5.0
"""A request times out after about one second, and others may be queued before it."""


@dataclass(frozen=True)
class LinkInfo:
    """What a link is at this moment."""

    port: str
    baud_rate: int | None
    """The rate at which the device answered; None if the port has none."""
    low_latency: bool | None
    """See `transport.Transport`."""
    device: DeviceInfo


class Link:
    """A link to one device.

    Args:
        port: Device path, pyserial URL, `socket://host:port` or `unix:path`; or, beside
            `open_port`, a name for what that opens.
        latest_sample: Takes the samples.
        baud_rate: Tried first.
        connect_timeout_s: How long to look for the device.
        stream_rate_hz: Rate of the samples; None leaves it to the device.
        watched: Ids of parameters whose values are always available from `values`.
        board_id: Accept only this board, at whichever free port it answers; `port` may then be
            glob patterns, separated by commas.
        any_board: Whether to continue with another board than the first, if the port leads to one.
        settings: Parameter id -> the value that the device is given whenever a session opens.
        open_port: Opens the transport in place of `port`, at a baud rate or without one; called
            again whenever it was lost. The link's thread calls it. It may raise any WheelwireError.
            It decides which board is the right one: any is.

    Raises:
        PortUnavailable: The port cannot be opened, or the board is at none.
        DeviceSilent: Nothing came.
        ForeignDevice: Bytes came, but no Wheelwire frame.
        ProtocolMismatch: Host and firmware are of different releases.
        DeviceRefused: The device refused the stream rate or a setting.
        RequestTimeout: A Wheelwire device answered, but no session could be opened in time.
    """

    def __init__(
        self,
        port: str,
        latest_sample: LatestSample,
        *,
        baud_rate: int,
        connect_timeout_s: float,
        stream_rate_hz: int | None = None,
        watched: Sequence[int] = (),
        board_id: str | None = None,
        any_board: bool = False,
        settings: Mapping[int, float] | None = None,
        open_port: OpenPort | None = None,
    ) -> None:
        self._port = port
        self._changed = Notifier()
        self._session = Session(
            _random_nonce,
            stream_rate_hz,
            watched,
            any_board=any_board or open_port is not None,
            settings=settings,
        )
        this = weakref.ref(self)
        self._loop = PortLoop(
            open_port or partial(_open_port, port, board_id),
            baud_rate,
            self._session,
            self._changed,
            latest_sample,
            is_wanted=lambda: this() is not None,
        )
        self._thread = threading.Thread(
            target=self._loop.run, name=f"wheelwire {port}", daemon=True
        )
        try:
            # Thread.start() waits for an Event: an exception out of a signal handler in there can
            # leave the new thread waiting for ever. No handler interrupts a thread but the main.
            _thread.start_new_thread(_start, (self._thread, self._loop))
            self._wait_for_port()
            self._wait_until_open(connect_timeout_s)
        except BaseException:
            self.close()
            raise

    @property
    def name(self) -> str:
        """The port, for display; while it is being searched for, the pattern or name given."""
        return self._loop.port or self._port

    @property
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""
        device, loop = self._session.device, self._loop
        if device is None:
            raise self._session.error
        return LinkInfo(loop.port, loop.policy.search.rate, loop.low_latency, device)

    @property
    def statistics(self) -> LinkStatistics:
        """What was counted since the link was opened."""
        counted = self._session.statistics(host_clock_us())
        return replace(counted, reconnects=self._loop.policy.reconnects)

    @property
    def sessions(self) -> int:
        """Number of sessions since the link was opened."""
        return self._session.count

    def values(self, parameters: Sequence[int]) -> tuple[float, ...]:
        """The newest values of watched parameters."""
        self.check()
        known = self._session.values
        try:
            return tuple([known[parameter] for parameter in parameters])
        except KeyError:  # a new session has just begun
            raise self._session.error from None

    def known(self, parameter: int) -> float | None:
        """The newest value of a parameter that was reported in this session, if there is one."""
        self.check()
        return self._session.values.get(parameter)

    def check(self) -> None:
        """Raise why the link is not open, if it is not."""
        self._check_alive()
        self._session.check_open()

    def drive_velocity(self, left_mps: float, right_mps: float, expiry_us: int) -> None:
        """Write one velocity setpoint in this thread; it expires at the host's `expiry_us`."""
        now_us = host_clock_us()
        self._loop.check_room()
        frame = self._session.velocity_frame(left_mps, right_mps, expiry_us, now_us)
        self._write(frame, now_us)

    def drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        """Write one duty setpoint; otherwise as `drive_velocity`."""
        now_us = host_clock_us()
        self._loop.check_room()
        self._write(self._session.duty_frame(left, right, expiry_us, now_us), now_us)

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer.

        Raises:
            DeviceRefused: The device refused it.
            LinkLost: The link is down, or went down before the answer came.
            RequestTimeout: No answer came.
        """
        answer = self._call(lambda done, now_us: self._session.request(message, done, now_us))
        return cast("Answer", answer)

    def post(self, message: RequestMessage, done: Heard) -> None:
        """Send a request without waiting; the link's thread calls `done` with the result."""

        def answered(result: Answer | WheelwireError | None) -> None:
            if result is not None:
                done(result)

        self._loop.call(lambda done, now_us: self._session.request(message, done, now_us), answered)

    def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """Stop and wait for the acknowledgement. Without a session it is sent all the same.

        Raises:
            LinkLost: There is no session: whether the stop arrived is unknown.
            RequestTimeout: No acknowledgement came.
        """
        self._call(lambda done, now_us: self._session.stop(mode, done, now_us))

    def estop(self) -> None:
        """Stop, latch and wait for the acknowledgement; otherwise as `stop`."""
        self._call(self._session.estop)

    def close(self) -> None:
        """Stop the robot, close the port and end the thread. Safe to call more than once."""
        self._loop.finish()
        if threading.current_thread() is self._thread:
            return  # called by the garbage collector; the thread ends when it returns to its loop
        # Not join() alone: when a signal handler's exception interrupts it, it may consider the
        # thread ended, so that a second close() would not wait.
        ended = self._changed.wait_for(lambda: self._loop.end is not None, JOIN_S)
        if ended and self._thread.is_alive():  # it may also have ended without a thread
            self._thread.join(JOIN_S)

    def _write(self, frame: bytes, now_us: int) -> None:
        try:
            self._loop.send(frame, now_us)
        except LinkLost:
            # Raise only after the port's thread has noticed: it may know a better reason, and a
            # caller that reads next must get no sample of a link that was reported lost.
            self._call(lambda done, _: done(None))
            raise

    def _call(self, task: Task) -> Answer | None:
        """Have the port's thread do `task`; return its result, or raise its error."""
        self._check_alive()
        self._session.check_connected()
        results: SimpleQueue[Answer | WheelwireError | None] = SimpleQueue()
        self._loop.call(task, results.put)
        try:
            result = results.get(timeout=CALL_TIMEOUT_S)
        except Empty:
            raise RequestTimeout(
                f"the link's thread did not answer for {CALL_TIMEOUT_S:g} s: whether it was done "
                "is not known; look at the port, and at what keeps this computer busy"
            ) from None
        if isinstance(result, WheelwireError):
            raise result.with_traceback(None)
        return result

    def _check_alive(self) -> None:
        if self._loop.end is not None:
            raise self._loop.end.with_traceback(None)

    def _wait_for_port(self) -> None:
        """Wait until the link's thread has opened the port; raise the error if it could not."""
        try:
            error = self._loop.opened.get(timeout=PORT_TIMEOUT_S)
        except Empty:
            raise PortUnavailable(
                self._port,
                f"opening it takes longer than {PORT_TIMEOUT_S:g} s: plug it in again, or restart "
                "the peer",
            ) from None
        if error is not None:
            try:
                raise error
            finally:
                del error  # its traceback holds this frame

    def _wait_until_open(self, timeout_s: float) -> None:
        def decided() -> bool:
            session = self._session
            final = isinstance(session.error, (ProtocolMismatch, DeviceRefused))
            return session.phase is Phase.OPEN or final or self._loop.end is not None

        if not self._changed.wait_for(decided, timeout_s):
            raise self._why_not_open(timeout_s)
        self.check()

    def _why_not_open(self, timeout_s: float) -> WheelwireError:
        session, tried = self._session, self._loop.policy.search.tried
        if session.answers:
            return RequestTimeout(
                f"{self._port} answers, but no session could be opened in {timeout_s:g} s "
                f"({session.error}): allow more time, look at the cable"
            )
        if not session.bytes_received and self._loop.policy.lost is not None:
            return PortUnavailable(self._port, str(self._loop.policy.lost))
        if session.bytes_received:
            return ForeignDevice(self._port, tried, session.bytes_received)
        return DeviceSilent(self._port, tried)


def _start(thread: threading.Thread, loop: PortLoop) -> None:
    try:
        thread.start()
    except RuntimeError as error:
        loop.fail(error)


def _open_port(port: str, board_id: str | None, baud_rate: int) -> Transport:
    if board_id is None:
        return open_transport(port, baud_rate)
    return open_board(port, board_id, baud_rate)


def _random_nonce() -> int:
    return int.from_bytes(os.urandom(4), "little")
