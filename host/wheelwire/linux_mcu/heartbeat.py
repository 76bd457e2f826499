"""A few words of memory that the core and its guard share."""

from __future__ import annotations

import enum
import mmap
import time
from collections.abc import Iterator
from contextlib import contextmanager


class Phase(enum.IntEnum):
    """How far the core has come."""

    OPENING = 0
    """It has moved no pin yet, or does so for the first time."""
    RUNNING = 1
    """It may drive."""
    CLOSED = 2
    """It has put EN low and given its pins back."""
    SAVING = 3
    """It writes a file, for seconds on a slow card. The core never asks for that while driving."""


class Heartbeat:
    """Made before the fork. Each word is written by one side only, and whole."""

    def __init__(self) -> None:
        self._words = memoryview(mmap.mmap(-1, mmap.PAGESIZE)).cast("q")

    def beat(self) -> None:
        """The core lives."""
        self._words[0] = time.monotonic_ns()

    @property
    def age_s(self) -> float:
        """Since the last beat."""
        return (time.monotonic_ns() - self._words[0]) / 1e9

    @property
    def phase(self) -> Phase:
        """The core's."""
        return Phase(self._words[1])

    @phase.setter
    def phase(self, phase: Phase) -> None:
        self.beat()
        self._words[1] = phase

    @contextmanager
    def saving(self) -> Iterator[None]:
        """Within it silence is no sign of a hang."""
        before, self.phase = self.phase, Phase.SAVING
        try:
            yield
        finally:
            self.phase = before

    @property
    def guarded(self) -> bool:
        """The guard is ready to act."""
        return bool(self._words[2])

    def guard_is_ready(self) -> None:
        """From now on the core may drive."""
        self._words[2] = 1
