"""Wheel velocity from ticks and the time between them, as the firmware measures it.

Ticks per control period are 0 or 1 at low speed, so velocity is measured from one tick to another
some time apart, and while the next tick does not come it is bounded by that.
"""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

STANDSTILL_US = 500_000
"""Without a tick for this long the wheel stands."""
CYCLE_TICKS = 4
"""A whole cycle of A and B: its four edges are not equally far apart, a cycle and the next are."""
PATIENCE = 4
"""A baseline of a whole cycle is worth waiting for, up to this many windows."""
OVERDUE = 1.5
"""A tick that has not come after this many of its periods says that the wheel has slowed."""


class Mark(NamedTuple):
    """A tick that was counted."""

    ticks: int
    t_us: int


class VelocityEstimator:
    """Of one wheel."""

    def __init__(self) -> None:
        self.ticks_per_s = 0.0
        """Forward positive."""
        self._marks: deque[Mark] = deque()
        self._latest = Mark(0, 0)
        self._direction = 0

    def update(self, change: int, t_us: int, window_us: int) -> None:
        """Take the ticks since the last call; call at every control step."""
        if change == 0:
            if self._marks:
                self._bound(t_us - self._latest.t_us)
            return
        direction = 1 if change > 0 else -1
        if direction != self._direction:
            # The time between two ticks of opposite direction says nothing about speed.
            self._reset()
            self._direction = direction
        self._latest = Mark(self._latest.ticks + change, t_us)
        self._measure(window_us)
        self._marks.append(self._latest)

    def _reset(self) -> None:
        self._marks.clear()
        self._direction = 0
        self.ticks_per_s = 0.0

    def _measure(self, window_us: int) -> None:
        marks, latest = self._marks, self._latest
        while len(marks) > 1:
            age_us = latest.t_us - marks[1].t_us
            whole_cycle = abs(latest.ticks - marks[1].ticks) >= CYCLE_TICKS
            if age_us < window_us or (not whole_cycle and age_us < PATIENCE * window_us):
                break
            marks.popleft()
        if marks and latest.t_us > marks[0].t_us:
            ticks = latest.ticks - marks[0].ticks
            self.ticks_per_s = ticks * 1e6 / (latest.t_us - marks[0].t_us)

    def _bound(self, silence_us: int) -> None:
        if silence_us >= STANDSTILL_US:
            self._reset()
        elif silence_us > 0:
            limit = OVERDUE * 1e6 / silence_us
            self.ticks_per_s = max(-limit, min(limit, self.ticks_per_s))
