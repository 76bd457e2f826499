"""How the link is doing: counted at the host's end, since it was opened."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass


@dataclass(frozen=True)
class LinkStatistics:
    """A snapshot. Counts never go back, but for `frames_lost`.

    Times are in microseconds, NaN before there is one.
    """

    frames_sent: int = 0
    frames_received: int = 0
    """Good frames of known messages."""
    frames_lost: int = 0
    """On the way to the host, by their sequence numbers. One that comes late is taken off again."""
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
    sessions: int = 0
    device_resets: int = 0
    reconnects: int = 0
    """How often the port was opened again."""
    round_trip_p50_us: float = math.nan
    round_trip_p99_us: float = math.nan
    clock_error_us: float = math.nan
    """Bound of the error of the device's clock as the host knows it."""

    @property
    def bad(self) -> int:
        """Chunks that did not decode to a valid, known message; as in the decoder's counters."""
        return self.bad_crc + self.bad_cobs + self.unknown_id + self.wrong_length


def quantile(values: Collection[float], fraction: float) -> float:
    """The nearest-rank quantile; NaN of nothing."""
    if not values:
        return math.nan
    ordered = sorted(values)
    return ordered[max(0, math.ceil(fraction * len(ordered)) - 1)]
