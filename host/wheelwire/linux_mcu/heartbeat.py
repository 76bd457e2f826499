"""A few words of memory shared by the core and its guard."""

from __future__ import annotations

import enum
import mmap
import time
from collections.abc import Iterator
from contextlib import contextmanager


class Phase(enum.IntEnum):
    """What the core is doing."""

    OPENING = 0
    """It is opening its pins."""
    RUNNING = 1
    """It may drive."""
    CLOSED = 2
    """It has pulled EN low and released its pins."""
    SAVING = 3
    """It writes a file, which takes seconds on a slow card. Never while driving."""


class Heartbeat:
    """Created before the fork. Each word is written by one side only."""

    def __init__(self) -> None:
        # Anonymous and shared: a fork keeps it. An aligned 64-bit store is atomic, so no lock.
        self._words = memoryview(mmap.mmap(-1, mmap.PAGESIZE)).cast("q")

    def beat(self) -> None:
        """Note that the core is alive."""
        self._words[0] = time.monotonic_ns()

    @property
    def age_s(self) -> float:
        """Time since the last beat."""
        # The monotonic clock is the same for both processes.
        return (time.monotonic_ns() - self._words[0]) / 1e9

    @property
    def phase(self) -> Phase:
        """The phase of the core."""
        return Phase(self._words[1])

    @phase.setter
    def phase(self, phase: Phase) -> None:
        self.beat()  # first: a new phase must not be judged by an old beat
        self._words[1] = phase

    @contextmanager
    def saving(self) -> Iterator[None]:
        """A block in which silence does not mean a hang."""
        before, self.phase = self.phase, Phase.SAVING
        try:
            yield
        finally:
            self.phase = before

    @property
    def guarded(self) -> bool:
        """Whether the guard is ready to act."""
        return bool(self._words[2])

    def guard_is_ready(self) -> None:
        """Let the core drive from now on."""
        self._words[2] = 1
