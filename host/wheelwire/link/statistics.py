"""The statistics of a link and a robot's health: loaded when a program first asks for them."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from wheelwire_protocol.codes import Fault, SupervisorState

from .holds import HeldBy

if TYPE_CHECKING:
    from .session import Session


@dataclass(frozen=True)
class LinkStatistics:
    """A snapshot. Counts never go back, but for `frames_lost`.

    Times are in microseconds, NaN before there is one.
    """

    frames_sent: int = 0
    frames_received: int = 0
    """Good frames of known messages."""
    frames_lost: int = 0
    """Frames lost on the way to the host, by sequence numbers. A late one no longer counts."""
    bad_crc: int = 0
    bad_cobs: int = 0
    unknown_id: int = 0
    wrong_length: int = 0
    repeated: int = 0
    """Frames that came twice."""
    stale_states: int = 0
    """State frames that were repeated or older than the newest: not made into samples."""
    invalid: int = 0
    """Good frames with a value that has no meaning."""
    foreign: int = 0
    """Answers to another session or to no request that is open."""
    refused: int = 0
    """Requests and setpoints that the device refused."""
    requests_repeated: int = 0
    setpoints_repeated: int = 0
    setpoints_expired: int = 0
    """Setpoints that the device refused because they came after their expiry."""
    sessions: int = 0
    device_resets: int = 0
    reconnects: int = 0
    """How often the port was opened again."""
    round_trip_p50_us: float = math.nan
    round_trip_p99_us: float = math.nan
    clock_error_us: float = math.nan
    """Bound of the error of the device's clock as the host knows it."""
    state_rate_hz: float = 0.0
    """New state frames in the last second."""
    recent_loss: float = 0.0
    """The part of the frames to the host that was lost in the last second, 0..1."""

    @property
    def bad(self) -> int:
        """Chunks that did not decode to a valid, known message; as in the decoder's counters."""
        return self.bad_crc + self.bad_cobs + self.unknown_id + self.wrong_length


class Health(NamedTuple):
    """Whether a robot is in reach and fit to drive, at one moment.

    Attributes:
        is_open: The robot is in reach.
        age_s: Since its newest sample arrived; None before the first.
        rate_hz: Samples that it sent in the last second.
        loss: The part of its frames that was lost in the last second, 0..1.
        clock_error_s: Bound of the error of its clock as the host knows it; NaN before it does.
        latched: ESTOPPED or FAULT if its newest sample says so; None if it may drive.
        faults: Its latched faults.
        setpoints_expired: Setpoints that arrived too late, since it was opened.
        ttl_max_s: The longest time to live that it takes; None while that is not known.
        held_by: What keeps it from driving, or from driving one way; false if nothing does, None
            while that is not known.
    """

    is_open: bool
    age_s: float | None
    rate_hz: float
    loss: float
    clock_error_s: float
    latched: SupervisorState | None
    faults: Fault
    setpoints_expired: int
    ttl_max_s: float | None
    held_by: HeldBy | None = None


def statistics_of(session: Session, now_us: int, reconnects: int) -> LinkStatistics:
    """A snapshot of all counters of a session."""
    counters, clock = session._decoder.counters, session._synchroniser.clock
    rate_hz, loss = session._recent.rate_and_loss(
        now_us, session._state_stream.new, session.frames_received, counters.seq_lost
    )
    return LinkStatistics(
        frames_sent=session._frames_sent_before + session._encoder.encoded,
        frames_received=session.frames_received,
        frames_lost=counters.seq_lost,
        bad_crc=counters.bad_crc,
        bad_cobs=counters.bad_cobs,
        unknown_id=counters.unknown_id,
        wrong_length=counters.wrong_length,
        repeated=counters.repeated,
        stale_states=session._state_stream.stale,
        invalid=session._invalid,
        foreign=session._foreign,
        refused=session._refused,
        requests_repeated=session._requests.repeated,
        setpoints_repeated=session.setpoints.repeated,
        setpoints_expired=session.setpoints.expired,
        sessions=session.count,
        device_resets=session._boots.resets,
        reconnects=reconnects,
        round_trip_p50_us=quantile(session._round_trips.newest_us, 0.50),
        round_trip_p99_us=quantile(session._round_trips.newest_us, 0.99),
        clock_error_us=(
            clock.conversion.host_to_device(now_us)[1] if clock.synchronised else float("nan")
        ),
        state_rate_hz=rate_hz,
        recent_loss=loss,
    )


def quantile(values: Collection[float], fraction: float) -> float:
    """The nearest-rank quantile; NaN of nothing."""
    if not values:
        return math.nan
    ordered = sorted(values)
    # Ranks count from 1; the one of fraction 0 would be 0, and is the smallest value.
    return ordered[max(0, math.ceil(fraction * len(ordered)) - 1)]
