"""The gyroscope's bias: what it measures while the robot stands. A filter would integrate it."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
LARGEST_RADPS = 0.06
"""The most by which temperature and age change a bias after it was measured for the board's file:
3.4 degrees a second. More means a turning robot: on a turntable, a lift or an arm."""
GRAVITY_MPS2 = 9.81
OFF_GRAVITY_MPS2 = 1.5
"""By how much the accelerometer of a robot at rest may differ from it: sensors have an offset."""


class GyroBias:
    """Measures the bias whenever wheels and accelerometer are at rest for a second. Pure.

    Args:
        noise_radps: Standard deviation of the gyroscope; 0: unknown, and no bias is taken.
        noise_mps2: Standard deviation of the accelerometer.
    """

    def __init__(self, noise_radps: float, noise_mps2: float) -> None:
        self.turning_radps = 0.0
        """The largest rate that was measured in a second of rest and is too large for a bias; 0:
        the last one was none."""
        self.radps: Vector = (0.0, 0.0, 0.0)
        """The bias about each axis; zeros before the first second of rest."""
        self._spread_radps = SPREAD * noise_radps
        self._spread_mps2 = SPREAD * noise_mps2
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
            self._take(rest)
            rest.clear()
        (x, y, z), bias = sample.gyro, self.radps
        return x - bias[0], y - bias[1], z - bias[2]

    def _take(self, rest: list[ImuSample]) -> None:
        """Take the bias from a second of rest, unless the robot was not at rest after all."""
        (x, y, z), turn = _mean_and_spread([one.gyro for one in rest])
        pull, shake = _mean_and_spread([one.acceleration for one in rest])
        is_upright = abs(math.hypot(*pull) - GRAVITY_MPS2) < OFF_GRAVITY_MPS2
        if turn >= self._spread_radps or shake >= self._spread_mps2 or not is_upright:
            return
        fastest = max(abs(x), abs(y), abs(z))
        self.turning_radps = fastest if fastest > LARGEST_RADPS else 0.0
        if not self.turning_radps:
            self.radps = x, y, z


def _mean_and_spread(vectors: Sequence[Vector]) -> tuple[Vector, float]:
    """The mean of each axis, and the largest difference between two samples of an axis."""
    axes = list(zip(*vectors, strict=True))
    x, y, z = (fmean(axis) for axis in axes)
    return (x, y, z), max(max(axis) - min(axis) for axis in axes)
