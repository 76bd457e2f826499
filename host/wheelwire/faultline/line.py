"""Both directions of a bad line and what happens to it, by script. Sans-IO and seeded."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from heapq import heapify, heappop, heappush
from random import Random

from .direction import Direction
from .profile import LineProfile

CUT_PATIENCE_US = 100_000
"""A device that is to be reset in the middle of a frame, but sends none, is reset after this."""


class Happening(enum.Enum):
    """What the line's owner has to do, since it has the ports and the device."""

    UNPLUG = enum.auto()
    PLUG = enum.auto()
    RESET = enum.auto()


class FaultLine:
    """The line between a host and a device.

    Args:
        profile: What is wrong with it.
        now_us: Any clock that does not go back; `at_s` counts from here.
    """

    def __init__(self, profile: LineProfile, now_us: int = 0) -> None:
        self.to_device = Direction(profile.to_device, Random(profile.seed))
        self.to_host = Direction(profile.to_host, Random(profile.seed + 1))
        # The number keeps incidents of the same time in the profile's order.
        self._script = [
            (now_us + round(incident.at_s * 1e6), number, incident)
            for number, incident in enumerate(profile.incidents)
        ]
        heapify(self._script)
        self._stalled_until_us: int | None = None
        self._unplugged_until_us: int | None = None
        self._reset_by_us: int | None = None

    def advance(self, now_us: int) -> list[Happening]:
        """Do what is due; returns what is left to the owner, in order."""
        happenings = [*self._begin_due(now_us)]
        if _is_due(self._stalled_until_us, now_us):
            self._stalled_until_us = None
            self.to_device.resume(now_us)
            self.to_host.resume(now_us)
        if _is_due(self._unplugged_until_us, now_us):
            self._unplugged_until_us = None
            happenings.append(Happening.PLUG)
        if _is_due(self._reset_by_us, now_us) or self._was_cut:
            self._reset_by_us = None
            happenings.append(Happening.RESET)
        return happenings

    @property
    def next_us(self) -> int | None:
        """When there is something to do; None while nothing is under way or planned."""
        moments = (
            self.to_device.next_us,
            self.to_host.next_us,
            self._script[0][0] if self._script else None,
            self._stalled_until_us,
            self._unplugged_until_us,
            self._reset_by_us,
        )
        return min((moment for moment in moments if moment is not None), default=None)

    def clear(self) -> None:
        """Lose all that is under way: the port is gone."""
        self.to_device.clear()
        self.to_host.clear()

    @property
    def _was_cut(self) -> bool:
        return self._reset_by_us is not None and not self.to_host.cut_pending

    def _begin_due(self, now_us: int) -> Iterator[Happening]:
        while self._script and self._script[0][0] <= now_us:
            due_us, number, incident = heappop(self._script)
            if incident.every_s:
                heappush(self._script, (due_us + round(incident.every_s * 1e6), number, incident))
            until_us = now_us + round(incident.for_s * 1e6)
            if incident.what == "stall":
                self._stalled_until_us = until_us
                self.to_device.stall()
                self.to_host.stall()
            elif incident.what == "unplug":
                self._unplugged_until_us = until_us
                self.clear()
                yield Happening.UNPLUG
            else:
                self._reset_by_us = now_us + CUT_PATIENCE_US
                self.to_host.cut_next()


def _is_due(moment_us: int | None, now_us: int) -> bool:
    return moment_us is not None and moment_us <= now_us
