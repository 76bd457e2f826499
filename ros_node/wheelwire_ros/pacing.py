"""Which samples are published, when the robot measures more often than was asked for."""

from __future__ import annotations

import math

from wheelwire import WheelSample

from .reader import SILENCE_S

EARLY = 0.125
"""Of a period: a sample this early counts as on time."""
SLOWEST_HZ = 2 / SILENCE_S
"""Of the robot's samples: one that is lost is no silence yet."""


def sampling_rate_hz(publish_rate_hz: float) -> int:
    """How often the robot is to measure: a multiple of the rate asked for, to thin evenly."""
    rate_hz = math.ceil(publish_rate_hz)
    return rate_hz * math.ceil(max(1.0, SLOWEST_HZ / rate_hz))


class Pacer:
    """Lets samples through at a rate, by their own clock.

    Args:
        rate_hz: At most.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_us = 1e6 / rate_hz
        self._due_us = 0.0
        self._boot_id: int | None = None

    def is_due(self, sample: WheelSample) -> bool:
        """Whether this one is to be published."""
        if sample.boot_id != self._boot_id:
            self._boot_id = sample.boot_id
            self._due_us = sample.t_us
        if sample.t_us < self._due_us - EARLY * self._period_us:
            return False
        late_us = sample.t_us - self._due_us
        if late_us > self._period_us:
            self._due_us = sample.t_us  # a gap is not made good by a burst
        self._due_us += self._period_us
        return True
