"""A wheel's quadrature encoder: rotation in, edges of A and B out, with typical faults."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from wheelwire.linux_mcu.encoder import A, B

LEVELS = ((0, 0), (1, 0), (1, 1), (0, 1))
"""Of A and B, a tick apart: forward, A leads B."""


class Edge(NamedTuple):
    """One level changed."""

    fraction: float
    """When: 0 at the beginning of the turn that made it, 1 at its end."""
    channel: int
    """A or B."""
    level: int


class Encoder:
    """On one wheel's axle.

    Args:
        counts_per_revolution: Ticks per wheel turn, x4.
    """

    def __init__(self, counts_per_revolution: int) -> None:
        self.dead = False
        """A and B are stuck."""
        self.reversed = False
        """A and B are swapped."""
        self.counts_per_revolution = counts_per_revolution
        self.a, self.b = LEVELS[0]
        self._position = 0.5  # between two edges: neither direction is a tick ahead

    @property
    def ticks(self) -> int:
        """The ticks that a perfect encoder and decoder would have counted."""
        return math.floor(self._position)

    def turn(self, angle_rad: float) -> Iterator[Edge]:
        """Turn the wheel evenly; yields the edges in order."""
        travel = angle_rad * self.counts_per_revolution / (2 * math.pi)
        start, first = self._position, self.ticks
        self._position += travel
        last = self.ticks
        if self.dead or first == last:
            return
        step = 1 if last > first else -1
        for interval in range(first + step, last + step, step):
            boundary = interval if step > 0 else interval + 1
            yield self._enter(LEVELS[interval % 4], (boundary - start) / travel)

    def _enter(self, levels: tuple[int, int], fraction: float) -> Edge:
        """Exactly one level changes; after a time stuck it may be either."""
        a, b = reversed(levels) if self.reversed else levels
        channel = A if a != self.a else B
        self.a, self.b = a, b
        return Edge(fraction, channel, a if channel == A else b)
