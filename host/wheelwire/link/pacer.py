"""Thins what a device sends to a lower rate, by the device's own clock."""

from __future__ import annotations

EARLY = 0.125
"""Fraction of a period by which a sample may be early and still count as on time."""


class Pacer:
    """Passes samples at a given rate, measured by the clock that made them: not by their arrival.

    Args:
        rate_hz: The highest rate.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period_us = 1e6 / rate_hz
        self._due_us = 0.0
        self._boot_id: int | None = None

    def is_due(self, t_us: int, boot_id: int) -> bool:
        """Whether a sample passes.

        Args:
            t_us: The device's clock at the measurement.
            boot_id: A new one means that this clock began anew.
        """
        if boot_id != self._boot_id:
            self._boot_id = boot_id
            self._due_us = t_us
        if t_us < self._due_us - EARLY * self._period_us:
            return False
        if t_us - self._due_us > self._period_us:
            self._due_us = t_us  # no burst after a gap
        # From the due time, not from the sample's: otherwise each late one would lower the rate.
        self._due_us += self._period_us
        return True
