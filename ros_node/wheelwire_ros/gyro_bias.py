"""The gyroscope's bias: what it measures while the robot stands. A filter would integrate it."""

from __future__ import annotations

from statistics import fmean

from wheelwire import ImuSample, WheelSample

Vector = tuple[float, float, float]
WINDOW_S = 1.0
LONGEST_GAP_S = 0.25
"""Longest gap between two samples of a window: in a longer one the robot may have moved."""
MOST_SAMPLES = 1100
"""Samples of a window: at 1000 Hz, the highest rate, and a little more."""
SPREAD = 20.0
"""Standard deviations of the chip's noise within which all samples of a robot at rest lie: some 6
by the noise, the rest for a lidar that spins. A hand that carries the robot turns it more."""
LARGEST_RADPS = 0.4
"""A larger rate is no bias: the data sheets' limit is 20 degrees a second."""


class GyroBias:
    """Measures the bias whenever the wheels stand for a second. Pure.

    Args:
        noise_radps: Standard deviation of a sample; 0: unknown, and no bias is taken.
    """

    def __init__(self, noise_radps: float) -> None:
        self.radps: Vector = (0.0, 0.0, 0.0)
        """The bias about each axis; zeros before the first second of rest."""
        self._spread_radps = SPREAD * noise_radps
        self._ticks: tuple[int, int] | None = None
        self._rest: list[ImuSample] = []

    def note_wheels(self, sample: WheelSample) -> None:
        """Take what the wheels have counted: while they turn nothing is at rest."""
        ticks = sample.left_ticks, sample.right_ticks
        if ticks != self._ticks or sample.left_duty or sample.right_duty:
            self._ticks = ticks
            self._rest.clear()

    def corrected(self, sample: ImuSample) -> Vector:
        """The rates without the bias."""
        rest = self._rest
        if rest and sample.stamp - rest[-1].stamp > LONGEST_GAP_S:
            rest.clear()
        rest.append(sample)
        if sample.stamp - rest[0].stamp >= WINDOW_S or len(rest) >= MOST_SAMPLES:
            axes = list(zip(*(one.gyro for one in rest), strict=True))
            x, y, z = (fmean(axis) for axis in axes)
            is_still = all(max(axis) - min(axis) < self._spread_radps for axis in axes)
            if is_still and max(abs(x), abs(y), abs(z)) < LARGEST_RADPS:
                self.radps = x, y, z
            rest.clear()
        (x, y, z), bias = sample.gyro, self.radps
        return x - bias[0], y - bias[1], z - bias[2]
