"""Notices another node of the same name. Pure: the time is an argument."""

from __future__ import annotations

import math

FORGOTTEN_S = 25.0
"""A node that was killed is on the graph until its lease ends, 20 s with Fast DDS: one that
restarts must not take its predecessor for a second robot."""


class TwinWatch:
    """Whether another node of this name lives."""

    def __init__(self) -> None:
        self.has_twin = False
        self._since_s = math.inf

    def look(self, nodes_of_this_name: int, now_s: float) -> bool:
        """Look at the graph; whether a twin was found just now.

        Args:
            nodes_of_this_name: This one included.
            now_s: On a monotonic clock.
        """
        if nodes_of_this_name < 2:
            self.has_twin, self._since_s = False, math.inf
            return False
        self._since_s = min(self._since_s, now_s)
        found = now_s - self._since_s >= FORGOTTEN_S
        is_new = found and not self.has_twin
        self.has_twin = found
        return is_new
