"""How a robot on local pins is doing: what its encoders and its control loop lost."""

from __future__ import annotations

from dataclasses import dataclass

from ..statistics import LinkStatistics


@dataclass(frozen=True)
class LocalStatistics(LinkStatistics):
    """A snapshot. Counts never go back; there are no frames, so their counts stay 0."""

    left_illegal_transitions: int = 0
    """Times that an edge of the left encoder was lost, as far as its decoder can tell."""
    right_illegal_transitions: int = 0
    """As `left_illegal_transitions`."""
    late_steps: int = 0
    """Control steps that came more than half a period late."""
    latest_step_us: int = 0
    """The longest time from one control step to the next."""
    saturated_steps: int = 0
    """How often a wheel's velocity loop wanted more than its output gives."""
