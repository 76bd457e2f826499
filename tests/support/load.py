"""The load of a process, as counted by the kernel, and the losses of its links."""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from typing import NamedTuple

from wheelwire import BaseDriver, LinkStatistics


class Load(NamedTuple):
    """Load of this process over some time."""

    cpu: float
    """CPU as a fraction of one core; may exceed 1."""
    wake_ups: float
    """Wake-ups of its threads per second."""


def load_while(work: Callable[[], object]) -> Load:
    """The load of this process while `work` runs in its calling thread."""
    wall, cpu, woken = time.monotonic(), time.process_time(), _wake_ups()
    work()
    elapsed = time.monotonic() - wall
    return Load((time.process_time() - cpu) / elapsed, (_wake_ups() - woken) / elapsed)


def read_for(seconds: float, driver: BaseDriver, reads_hz: int) -> None:
    """Ask a driver for a sample so many times a second; 0: let the time pass."""
    if reads_hz == 0:
        time.sleep(seconds)
        return
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        time.sleep(1 / reads_hz)
        driver.read()


def frames_lost(before: LinkStatistics, after: LinkStatistics) -> int:
    """Frames lost of those that were sent to the host between two snapshots."""
    return after.frames_lost + after.bad - before.frames_lost - before.bad


def _wake_ups() -> int:
    """Counted by voluntary context switches: a thread that waits is woken later."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_nvcsw
