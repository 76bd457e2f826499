"""The guard: pulls EN low if the core's process dies or hangs while it holds the pins.

A killed process leaves its outputs as they were: with EN high the wheels would not stop turning.
Core and guard share a heartbeat, and both ask for real-time scheduling.
"""

from __future__ import annotations

import ctypes
import enum
import gc
import mmap
import os
import select
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..errors import WheelwireError

CHECK_S = 0.01
CORE_PRIORITY = 40
READER_PRIORITY = 39
"""Priority of the readers of I2C buses: below the core's."""
GUARD_PRIORITY = 41
"""Above the core's: the guard must run even if the core hogs the processor."""
_MCL_CURRENT, _MCL_FUTURE = 1, 2


class Phase(enum.IntEnum):
    """What the core is doing."""

    OPENING = 0
    """The core opens its pins."""
    RUNNING = 1
    """The core may drive."""
    CLOSED = 2
    """The core has pulled EN low and released its pins."""
    SAVING = 3
    """The core writes a file, which takes seconds on a slow card. Never while driving."""


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


def request_realtime(priority: int) -> str | None:
    """Request real-time priority and locked memory for this process.

    Returns:
        What was not permitted, in a sentence; None if nothing was refused.
    """
    # Collected first, or the garbage of the start would stay for ever.
    gc.collect()
    gc.freeze()  # garbage collection need not scan the objects of the start again
    refused = []
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError:
        refused.append("real-time priority (LimitRTPRIO)")
    # A page that has to be read back would hold up a step. Python itself has no mlockall.
    if ctypes.CDLL(None).mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        refused.append("locked memory (LimitMEMLOCK)")
    if not refused:
        return None
    return (
        f"not permitted: {' and '.join(refused)}; on a busy computer the control loop will run late"
    )


def watch(
    core_pid: int,
    heartbeat: Heartbeat,
    core_timeout_s: float,
    prepare_enable_low: Callable[[], Callable[[], None]],
) -> int:
    """Wait until the core's process has ended, by itself or killed by the guard.

    Args:
        core_pid: A child of this process.
        heartbeat: Shared with the core.
        core_timeout_s: A running core that is silent for longer is killed; only then can the guard
            claim its pins.
        prepare_enable_low: Does the slow part in advance; the function it returns pulls EN low.

    Returns:
        The exit status of the core's process.
    """
    # A pidfd, because waitpid has no time-out, and the guard must also check the heartbeat.
    core = os.pidfd_open(core_pid)
    enable_low = _prepared(prepare_enable_low, heartbeat)
    while not _ended(core):
        if heartbeat.phase is Phase.RUNNING and heartbeat.age_s > core_timeout_s:
            # If the guard itself was not scheduled for a while, the core may not have been either.
            # Give it one check's time to beat again before killing it.
            if _ended(core, wait_s=CHECK_S) or heartbeat.age_s <= core_timeout_s:
                continue
            os.kill(core_pid, signal.SIGKILL)
    # Reaped only here: until then its pid cannot become another process's, which would be killed.
    _, status = os.waitpid(core_pid, 0)
    # A core that closed its pins has pulled EN low itself, and another program may own them now.
    if heartbeat.phase in (Phase.RUNNING, Phase.SAVING):
        enable_low()
    os.close(core)
    return os.waitstatus_to_exitcode(status)


def _prepared(
    prepare_enable_low: Callable[[], Callable[[], None]], heartbeat: Heartbeat
) -> Callable[[], None]:
    try:
        enable_low = prepare_enable_low()
    except WheelwireError:  # the core runs into the same error and reports it
        return lambda: None
    heartbeat.guard_is_ready()
    return enable_low


def _ended(core: int, wait_s: float = CHECK_S) -> bool:
    return bool(select.select([core], [], [], wait_s)[0])
