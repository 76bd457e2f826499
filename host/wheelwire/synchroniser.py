"""When to ping, and what the answers say about the device's clock. Sans-IO."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from wheelwire_protocol.types import Ping, Pong

from .clock import ClockEstimator, Exchange
from .requests import ID_MODULUS

BURST = 8
"""Pings at the start of a session, each sent when the former is answered, or lost."""
BURST_TIMEOUT_US = 25_000
"""Also between pings until the first answer; one that comes later is taken all the same."""
PERIOD_US = 500_000
OPEN_PINGS = 80
"""Unanswered pings remembered, two seconds of them; older ones are taken for lost."""
MAX_DEVICE_US = 1 << 62
SLACK_US = 1000
"""A device may seem to have held a ping this much longer than the whole exchange took."""


@dataclass
class Synchroniser:
    """Keeps the clock of one session.

    Args:
        session_id: The session's.
        send: Takes a message for the line.
        due_us: When the next ping is due, on the host's clock.
        sent_us: When the last one was sent.
    """

    session_id: int
    send: Callable[[Ping], None]
    due_us: int
    sent_us: int = 0
    clock: ClockEstimator = field(default_factory=ClockEstimator)
    _burst_left: int = BURST
    _last_id: int = 0
    """Of its own: a request's id far ahead of the one before it is an old one to the device."""
    _open: dict[int, int] = field(default_factory=dict)

    @property
    def ready(self) -> bool:
        """The first burst is sent and the clock is known."""
        return self._burst_left <= 0 and self.clock.synchronised

    def awaits_pong(self, now_us: int) -> bool:
        """Whether an answer is likely still to come."""
        return bool(self._open) and now_us < self.sent_us + BURST_TIMEOUT_US

    def ping(self, now_us: int) -> None:
        """Send a ping. A lost one is never repeated: its time would be wrong."""
        self._last_id = request_id = (self._last_id + 1) % ID_MODULUS
        self._open[request_id] = now_us
        if len(self._open) > OPEN_PINGS:
            del self._open[next(iter(self._open))]
        self._burst_left -= 1
        self.sent_us = now_us
        self.due_us = now_us + (PERIOD_US if self.ready else BURST_TIMEOUT_US)
        self.send(Ping(self.session_id, request_id, now_us))

    def on_pong(self, pong: Pong, now_us: int) -> Exchange | None:
        """Take an answer that came at `now_us`; None when it answers no open ping, or cannot be."""
        if self._open.get(pong.request_id) != pong.host_us:
            return None
        held_us = pong.sent_us - pong.received_us
        if not 0 <= held_us <= now_us - pong.host_us + SLACK_US or pong.sent_us > MAX_DEVICE_US:
            return None
        del self._open[pong.request_id]
        exchange = Exchange(pong.host_us, pong.received_us, pong.sent_us, now_us)
        self.clock.add(exchange)
        self.due_us = now_us + PERIOD_US if self._burst_left <= 0 else now_us
        return exchange
