"""The simulator's process, seen from this one."""

from __future__ import annotations

import subprocess

from wheelwire.simulation.simulator import Simulator


class LongRunning:
    """A process that ends by itself while it is waited for, in the third wait."""

    def __init__(self) -> None:
        self.waits = 0

    def wait(self, timeout: float) -> int:
        self.waits += 1
        if self.waits < 3:
            raise subprocess.TimeoutExpired("simulator", timeout)
        return 3


def test_no_wait_for_its_end_lasts_for_ever() -> None:
    """A signal that comes just before a wait is handled after it."""
    simulator = Simulator()
    process = LongRunning()
    simulator._process = process  # type: ignore[assignment]
    assert simulator.wait() == 3
    assert process.waits == 3
    simulator._process = None
