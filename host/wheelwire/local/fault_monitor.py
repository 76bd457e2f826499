"""One wheel's encoder and motor, watched for what closes the loop the wrong way or not at all."""

from __future__ import annotations

import enum

from .settings import FaultThresholds

RESTING_TICKS = 1
"""One tick to and fro is an encoder resting on an edge, not a wheel that turns."""


class WheelFault(enum.Enum):
    """What is wrong with one wheel."""

    NOT_COUNTING = "not counting"
    REVERSED = "reversed"


class FaultMonitor:
    """As the firmware's; call `update` once per control step."""

    def __init__(self) -> None:
        self._hard_since_us: int | None = None
        self._anchor_ticks = 0
        self._least_mps: float | None = None

    def reset(self) -> None:
        """The wheel is not driven."""
        self._hard_since_us = None
        self._least_mps = None

    def update(
        self,
        duty: float,
        ticks: int,
        measured_mps: float,
        now_us: int,
        thresholds: FaultThresholds,
    ) -> WheelFault | None:
        """Judge the duty that was on the output since the last step, and what came of it."""
        if self._not_counting(duty, ticks, now_us, thresholds):
            return WheelFault.NOT_COUNTING
        if self._reversed(duty, measured_mps, thresholds):
            return WheelFault.REVERSED
        return None

    def _not_counting(
        self, duty: float, ticks: int, now_us: int, thresholds: FaultThresholds
    ) -> bool:
        if abs(duty) < thresholds.stall_duty:
            self._hard_since_us = None
            return False
        moved = abs(ticks - self._anchor_ticks) > RESTING_TICKS
        if self._hard_since_us is None or moved:
            self._hard_since_us = now_us
            self._anchor_ticks = ticks
        return now_us - self._hard_since_us >= thresholds.stall_time_us

    def _reversed(self, duty: float, measured_mps: float, thresholds: FaultThresholds) -> bool:
        """Braking drives against the motion too, but then the speed falls; here it grows."""
        if abs(duty) < thresholds.reversal_duty or duty * measured_mps >= 0:
            self._least_mps = None
            return False
        speed = abs(measured_mps)
        self._least_mps = speed if self._least_mps is None else min(self._least_mps, speed)
        return speed - self._least_mps >= thresholds.reversal_mps
