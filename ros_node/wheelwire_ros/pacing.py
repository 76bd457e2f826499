"""Chooses the samples to publish if the robot measures more often than requested."""

from __future__ import annotations

import math

from wheelwire import WheelSample

from .reader import SILENCE_S

EARLY = 0.125
"""Fraction of a period by which a sample may be early and still count as on time."""
SLOWEST_HZ = 2 / SILENCE_S
"""Lowest sampling rate: so that one lost sample does not count as silence."""


def sampling_rate_hz(publish_rate_hz: float) -> int:
    """The rate of the robot's samples: a multiple of the requested rate, to thin them evenly."""
    rate_hz = math.ceil(publish_rate_hz)
    return rate_hz * math.ceil(max(1.0, SLOWEST_HZ / rate_hz))


class Pacer:
    """Passes samples at a given rate, measured by their own clock.

    Args:
        rate_hz: The highest rate.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_us = 1e6 / rate_hz
        self._due_us = 0.0
        self._boot_id: int | None = None

    def is_due(self, sample: WheelSample) -> bool:
        """Whether to publish this sample."""
        if sample.boot_id != self._boot_id:
            # The device's clock began anew.
            self._boot_id = sample.boot_id
            self._due_us = sample.t_us
        if sample.t_us < self._due_us - EARLY * self._period_us:
            return False
        late_us = sample.t_us - self._due_us
        if late_us > self._period_us:
            self._due_us = sample.t_us  # no burst after a gap
        # From the due time, not from the sample's: otherwise each late one would lower the rate.
        self._due_us += self._period_us
        return True
