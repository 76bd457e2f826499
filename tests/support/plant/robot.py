"""The model robot: two wheels that are advanced when they are read."""

from __future__ import annotations

from collections.abc import Callable

from wheelwire.linux_mcu.gpio.base import WheelPair

from .encoder import Edge
from .motor import LONGEST_STEP_S, MotorModel
from .wheel import SimulatedWheel

LONGEST_STEP_US = round(LONGEST_STEP_S * 1e6)

EdgeSink = Callable[[int, Edge, float], None]
"""Called with the wheel (0 left, 1 right), the edge, and its time in microseconds."""


class ModelRobot:
    """Two wheels that do not influence each other.

    Args:
        model: Of both wheels.
        counts_per_revolution: Of both encoders, x4.
        now_us: Its clock's time now.

    Attributes:
        left: Its `motor` can be `blocked`, `reversed` or loaded, its `encoder` `dead`, `reversed`.
        right: As `left`.
    """

    def __init__(self, model: MotorModel, counts_per_revolution: int, now_us: int) -> None:
        self.left = SimulatedWheel(model, counts_per_revolution)
        self.right = SimulatedWheel(model, counts_per_revolution)
        self._now_us = now_us

    @property
    def wheels(self) -> tuple[SimulatedWheel, SimulatedWheel]:
        """Left, right."""
        return self.left, self.right

    @property
    def true_ticks(self) -> WheelPair:
        """The ticks that perfect encoders would have counted since the start."""
        return WheelPair(self.left.encoder.ticks, self.right.encoder.ticks)

    def advance_to(self, now_us: int, sink: EdgeSink, longest_us: int | None = None) -> None:
        """Let time pass until `now_us`; the edges go to `sink`, each wheel's in their order.

        A gap longer than `longest_us` is skipped: the process was stopped.
        """
        if longest_us is not None:
            self._now_us = max(self._now_us, now_us - longest_us)
        while self._now_us < now_us:
            step_us = min(LONGEST_STEP_US, now_us - self._now_us)
            for side, wheel in enumerate(self.wheels):
                for edge in wheel.step(step_us / 1e6):
                    sink(side, edge, self._now_us + edge.fraction * step_us)
            self._now_us += step_us
