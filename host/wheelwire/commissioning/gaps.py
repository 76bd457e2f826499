"""Gaps in an encoder's counts: where a magnet is missing, its edges come late and all at once."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from ..samples import WheelSample

_BUNCH_TICKS = 5
"""Fewer than that could be an uneven encoder."""


def has_gap(samples: Sequence[WheelSample], side: int) -> bool:
    """Whether counts stop for a while, and what was missed comes at once.

    Args:
        samples: Of a wheel that turns steadily, in either direction.
        side: Of the counter.
    """
    steps = [
        (later.since(earlier)[side], later.since(earlier).dt_s)
        for earlier, later in pairwise(samples)
    ]
    travel = sum(ticks for ticks, _ in steps)
    if not travel:
        return False
    forward = [(math.copysign(1, travel) * ticks, seconds) for ticks, seconds in steps]
    rate = abs(travel) / sum(seconds for _, seconds in steps)
    typical = median(ticks for ticks, _ in forward)
    still_s, still_samples = 0.0, 0
    for ticks, seconds in forward:
        if ticks == 0:
            still_s, still_samples = still_s + seconds, still_samples + 1
            continue
        # A wheel that hesitated does not make up for what it missed.
        missed = rate * still_s
        if still_samples > 1 and missed >= _BUNCH_TICKS and ticks > typical + missed / 2:
            return True
        still_s, still_samples = 0.0, 0
    return False
