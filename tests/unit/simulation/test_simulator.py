"""The simulator's process, seen from this one."""

from __future__ import annotations

import subprocess
from unittest.mock import Mock

from wheelwire.simulation.simulator import Simulator


def test_no_wait_for_its_end_lasts_for_ever() -> None:
    """A signal that comes just before a wait is handled after it."""
    simulator = Simulator()
    goes_on = subprocess.TimeoutExpired("simulator", 1)
    wait = Mock(side_effect=[goes_on, goes_on, 3])
    simulator._process = Mock(wait=wait)
    assert simulator.wait() == 3
    assert [len(call.args) for call in wait.call_args_list] == [1] * 3  # each with a time-out
    simulator._process = None
