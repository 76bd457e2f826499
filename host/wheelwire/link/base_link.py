"""What an open link does without waiting: the same on a thread and on asyncio."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from ..errors import (
    BoardMismatch,
    DeviceRefused,
    DeviceSilent,
    ForeignDevice,
    PortUnavailable,
    ProtocolMismatch,
    RequestTimeout,
    WheelwireError,
)
from .clock import host_clock_us
from .info import ActiveBoard, DeviceInfo, ExpectedBoard, LinkStatistics
from .news import Happening, Listener
from .served_port import OpenPort, ServedPort
from .session import Phase, Session

if TYPE_CHECKING:
    from .transports import Transport

CONNECT_TIMEOUT_S = 5.0
"""How long to look for the device, unless the application says otherwise."""
PORT_TIMEOUT_S = 60.0
"""A process that moves pins takes up to 28 s to start, an unreachable name server half a minute."""
CALL_TIMEOUT_S = 5.0
"""A request times out after about one second, and others may be queued before it."""
CLOSE_TIMEOUT_S = 10.0
"""Longer than a port needs to close: a process at the other end brakes for up to 5 s."""


@dataclass(frozen=True)
class LinkInfo:
    """What a link is at this moment."""

    port: str
    baud_rate: int | None
    """The rate at which the device answered; None if the port has none."""
    low_latency: bool | None
    """See `transports.Transport`."""
    device: DeviceInfo
    board: ActiveBoard | None
    """The board that the device is on; None until it has said so, and where it cannot tell."""


@dataclass(frozen=True)
class LinkOptions:
    """What a link leads to, and how it is opened.

    Attributes:
        port: Device path, pyserial URL, `socket://host:port` or `unix:path`; or, beside
            `open_port`, a name for what that opens.
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
            It decides which board is the right one: any is.
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

    def session(self) -> Session:
        """A session that is prepared as they say."""
        return Session(
            _random_nonce,
            self.stream_rate_hz,
            self.watched,
            any_board=self.any_board or self.open_port is not None,
            settings=self.settings,
            expected_board=self.expected_board,
        )

    @property
    def opener(self) -> OpenPort:
        """What opens the port."""
        return self.open_port or partial(_open_port, self.port, self.board_id)


class BaseLink(ABC):
    """A link to one device. Derived classes serve the port, and wait for answers.

    Args:
        options: What it leads to.
        session: Made by the options.
        served: The port, which this link finishes.
    """

    def __init__(self, options: LinkOptions, session: Session, served: ServedPort) -> None:
        self._options = options
        self._session = session
        self._served = served

    @property
    def name(self) -> str:
        """The port, for display; while it is being searched for, the pattern or name given."""
        return self._served.port or self._options.port

    @property
    def info(self) -> LinkInfo:
        """Port, baud rate and device."""
        device, served = self._session.device, self._served
        if device is None:
            raise self._session.error
        # Not the port's own rate: during a search that is one of those that are tried.
        rate, board = served.policy.search.rate, self._session.board
        return LinkInfo(served.port, rate, served.low_latency, device, board)

    @property
    def statistics(self) -> LinkStatistics:
        """What was counted since the link was opened."""
        counted = self._session.statistics(host_clock_us())
        return replace(counted, reconnects=self._served.policy.reconnects)

    @property
    def sessions(self) -> int:
        """Number of sessions since the link was opened."""
        return self._session.count

    @property
    def rolling_mps(self) -> float | None:
        """As `Session.rolling_mps`."""
        return self._session.rolling_mps

    @property
    def watched_values(self) -> Mapping[int, float]:
        """The newest values of the watched parameters, by id: the same object until one changes."""
        values = self._session.watched_values
        # The end of the serving ends the session as well, so there is nothing else to look at.
        if values is None:
            self._check_alive()
            raise self._session.error.with_traceback(None)
        return values

    @property
    def watched_if_open(self) -> Mapping[int, float] | None:
        """As `watched_values`; None while no session is open."""
        return self._session.watched_values

    def known(self, parameter: int) -> float | None:
        """The newest value of a parameter that was reported in this session, if there is one."""
        self.check()
        return self._session.values.get(parameter)

    def check(self) -> None:
        """Raise why the link is not open, if it is not."""
        self._check_alive()
        self._session.check_open()

    def release_trial(self) -> None:
        """The application has left its trial of parameters."""
        self._session.release_trial()

    def drive_velocity(self, left_mps: float, right_mps: float, expiry_us: int) -> None:
        """Write one velocity setpoint at once; it expires at the host's `expiry_us`."""
        now_us = host_clock_us()
        # Before a frame is made, which would be noted for a repeat and so be sent after all.
        self._served.check_room()
        setpoints = self._session.setpoints
        self._write(setpoints.velocity_frame(left_mps, right_mps, expiry_us, now_us), now_us)

    def drive_duty(self, left: float, right: float, expiry_us: int) -> None:
        """Write one duty setpoint; otherwise as `drive_velocity`."""
        now_us = host_clock_us()
        self._served.check_room()
        setpoints = self._session.setpoints
        self._write(setpoints.duty_frame(left, right, expiry_us, now_us), now_us)

    @abstractmethod
    def listen(self, listener: Listener, happening: Happening) -> None:
        """Tell `listener` what happens from now on; of `happening` also what is so already."""

    @abstractmethod
    def _write(self, frame: bytes, now_us: int) -> None:
        """Write a setpoint's frame. LinkLost is raised only once everybody can see the loss."""

    def _check_alive(self) -> None:
        # Every call from here on raises the same error: tracebacks must not pile up in it.
        if self._served.end is not None:
            raise self._served.end.with_traceback(None)

    @staticmethod
    def _call_takes_too_long() -> RequestTimeout:
        return RequestTimeout(
            f"the link gave no answer for {CALL_TIMEOUT_S:g} s: whether it was done is not known; "
            "look at the port, and at what keeps this computer busy"
        )

    # --- while it is being opened --------------------------------------------------------------

    def _opening_is_decided(self) -> bool:
        """A session is open, or waiting for one is in vain."""
        session = self._session
        # Neither passes by itself while a link is being opened; all else may.
        final = isinstance(session.error, (ProtocolMismatch, DeviceRefused, BoardMismatch))
        return session.phase is Phase.OPEN or final or self._served.end is not None

    def _port_takes_too_long(self) -> PortUnavailable:
        return PortUnavailable(
            self._options.port,
            f"opening it takes longer than {PORT_TIMEOUT_S:g} s: plug it in again, or restart "
            "the peer",
        )

    def _why_not_open(self) -> WheelwireError:
        """Why no session was opened within the connect timeout."""
        session, policy = self._session, self._served.policy
        port, tried = self._options.port, policy.search.tried
        # Whoever answers a hello is a Wheelwire device at this rate, whatever else is wrong.
        if session.answers:
            return RequestTimeout(
                f"{port} answers, but no session could be opened in "
                f"{self._options.connect_timeout_s:g} s ({session.error}): allow more time, look "
                "at the cable"
            )
        # A port that was lost without a byte says more than that it was silent.
        if not session.bytes_received and policy.lost is not None:
            return PortUnavailable(port, str(policy.lost))
        # Bytes without an answer: another kind of device, or a rate that was not tried.
        if session.bytes_received:
            return ForeignDevice(port, tried, session.bytes_received)
        return DeviceSilent(port, tried)


def _open_port(port: str, board_id: str | None, baud_rate: int) -> Transport:
    # Here, for not every link needs what they import.
    from .discovery import open_board
    from .transports import open_transport

    if board_id is None:
        return open_transport(port, baud_rate)
    return open_board(port, board_id, baud_rate)


def _random_nonce() -> int:
    # Not from `random`: a program that seeds it would draw the nonces of its last run again, and
    # the device would take its session for the one that is open.
    return int.from_bytes(os.urandom(4), "little")
