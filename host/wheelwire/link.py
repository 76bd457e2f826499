"""An open link, for any thread: commands and requests in, information out.

The session is guarded by one lock. A call leaves its frames in the session and wakes the port's
thread, which alone touches the port.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from queue import SimpleQueue

from wheelwire_protocol.codes import StopMode

from .clock import host_clock_us
from .device import DeviceInfo
from .errors import (
    DeviceRefused,
    DeviceSilent,
    ForeignDevice,
    ProtocolMismatch,
    RequestTimeout,
    WheelwireError,
)
from .identify import open_board
from .inbox import SampleInbox
from .port_loop import PortLoop
from .requests import Answer, Done, RequestMessage
from .session import Phase, Session
from .statistics import LinkStatistics
from .transport import Transport, open_transport

OpenPort = Callable[[int], Transport]

JOIN_S = 2.0
"""Longer than the port's thread needs to end; it is a daemon in any case."""


@dataclass(frozen=True)
class LinkInfo:
    """What a link is at this moment."""

    port: str
    baud_rate: int | None
    """The one at which the device answered; None where there is none."""
    low_latency: bool | None
    """See `transport.Transport`."""
    device: DeviceInfo


class Link:
    """A link to one device.

    Args:
        port: Device path, pyserial URL, `socket://host:port` or `unix:path`; or, beside
            `open_port`, a name for what that opens.
        inbox: Takes the samples.
        baud_rate: Tried first.
        connect_timeout_s: How long to look for the device.
        stream_rate_hz: Rate of the samples; None leaves it to the device.
        watched: Ids of parameters whose values are always at hand in `values`.
        board_id: Only this board will do, at whichever free port it answers; `port` may then be
            glob patterns, separated by commas.
        open_port: Opens the transport in place of `port`, at a baud rate or without one; called
            again whenever it was lost. It may raise any WheelwireError.

    Raises:
        PortUnavailable: The port cannot be opened, or the board is at none.
        DeviceSilent: Nothing came.
        ForeignDevice: Something came, but nothing of ours.
        ProtocolMismatch: Host and firmware are of different releases.
        DeviceRefused: The device does not take the stream rate.
        RequestTimeout: A device of ours answered, but no session could be opened in time.
    """

    def __init__(
        self,
        port: str,
        inbox: SampleInbox,
        *,
        baud_rate: int,
        connect_timeout_s: float,
        stream_rate_hz: int | None = None,
        watched: Sequence[int] = (),
        board_id: str | None = None,
        open_port: OpenPort | None = None,
    ) -> None:
        self._port = port
        self._changed = threading.Condition()
        self._session = Session(_random_nonce, stream_rate_hz, watched)
        open_port = open_port or partial(_open_port, port, board_id)
        transport = open_port(baud_rate)
        self._loop = PortLoop(transport, open_port, self._session, self._changed, inbox)
        self._thread = threading.Thread(
            target=self._loop.run, name=f"wheelwire {port}", daemon=True
        )
        self._thread.start()
        try:
            self._wait_until_open(connect_timeout_s)
        except BaseException:
            self.close()
            raise

    @property
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""
        with self._changed:
            device, loop = self._session.device, self._loop
            if device is None:
                raise self._session.error
            return LinkInfo(loop.port, loop.baud_rate, loop.low_latency, device)

    @property
    def statistics(self) -> LinkStatistics:
        """What was counted since the link was opened."""
        with self._changed:
            counted = self._session.statistics(host_clock_us())
            return replace(counted, reconnects=self._loop.reconnects)

    @property
    def sessions(self) -> int:
        """How many there were since the link was opened."""
        with self._changed:
            return self._session.count

    def value(self, parameter: int) -> float:
        """The newest value of a watched parameter."""
        with self._changed:
            self.check()
            return self._session.values[parameter]

    def check(self) -> None:
        """Raise why the link is not open, if it is not."""
        with self._changed:
            self._check_alive()
            self._session.check_open()

    def drive_velocity(self, left_mps: float, right_mps: float, expiry_us: int) -> None:
        """Send one velocity setpoint, void from the host's `expiry_us` on. Does not wait."""
        with self._changed:
            self.check()
            self._session.drive_velocity(left_mps, right_mps, expiry_us, host_clock_us())
        self._loop.wake()

    def drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        """Send one duty setpoint, void from the host's `expiry_us` on. Does not wait."""
        with self._changed:
            self.check()
            self._session.drive_duty(left, right, expiry_us, host_clock_us())
        self._loop.wake()

    def request(self, message: RequestMessage) -> Answer:
        """Send a request and wait for its answer.

        Raises:
            DeviceRefused: As it says.
            LinkLost: The link is down, or went down before the answer came.
            RequestTimeout: No answer came.
        """

        def submit(done: Done, now_us: int) -> None:
            self._session.request(message, done, now_us)

        return self._answer(submit)

    def stop(self, mode: StopMode = StopMode.CONFIGURED) -> None:
        """Stop and wait for the acknowledgement. Without a session it is sent all the same.

        Raises:
            LinkLost: There is no session: whether the stop arrived is not known.
            RequestTimeout: No acknowledgement came.
        """

        def submit(done: Done, now_us: int) -> None:
            self._session.stop(mode, done, now_us)

        self._answer(submit)

    def estop(self) -> None:
        """Stop, latch and wait for the acknowledgement; otherwise as `stop`."""
        self._answer(self._session.estop)

    def finish(self) -> None:
        """Begin to close: stop the robot, close the port. Does not wait, takes no lock."""
        self._loop.finish()

    def close(self) -> None:
        """Stop the robot, close the port and end the thread. Harmless when repeated."""
        self.finish()
        if threading.current_thread() is not self._thread:
            self._thread.join(JOIN_S)

    def _answer(self, submit: Callable[[Done, int], None]) -> Answer:
        replies: SimpleQueue[Answer | WheelwireError] = SimpleQueue()
        with self._changed:
            self._check_alive()
            submit(replies.put, host_clock_us())
        self._loop.wake()
        reply = replies.get()
        if isinstance(reply, WheelwireError):
            raise reply.with_traceback(None)
        return reply

    def _check_alive(self) -> None:
        if self._loop.end is not None:
            raise self._loop.end.with_traceback(None)

    def _wait_until_open(self, timeout_s: float) -> None:
        def decided() -> bool:
            session = self._session
            final = isinstance(session.error, (ProtocolMismatch, DeviceRefused))
            return session.phase is Phase.OPEN or final or self._loop.end is not None

        with self._changed:
            if not self._changed.wait_for(decided, timeout_s):
                raise self._why_not_open(timeout_s)
            self.check()

    def _why_not_open(self, timeout_s: float) -> WheelwireError:
        session, tried = self._session, self._loop.search.tried
        if session.answered:
            return RequestTimeout(
                f"{self._port} answers, but no session could be opened in {timeout_s:g} s "
                f"({session.error}): allow more time, look at the cable"
            )
        if session.bytes_received:
            return ForeignDevice(self._port, tried, session.bytes_received)
        return DeviceSilent(self._port, tried)


def _open_port(port: str, board_id: str | None, baud_rate: int) -> Transport:
    if board_id is None:
        return open_transport(port, baud_rate)
    return open_board(port, board_id, baud_rate)


def _random_nonce() -> int:
    return int.from_bytes(os.urandom(4), "little")
