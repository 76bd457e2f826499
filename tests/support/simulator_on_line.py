"""The lines that the simulated robot is tested on: a good one, and bad ones."""

from __future__ import annotations

from typing import Any

from wheelwire.simulation.impaired_simulator import ImpairedSimulator
from wheelwire.simulation.simulator import Simulator
from wheelwire.tools.files.bad_line import load_profile

GOOD = "good"


def simulator_on(line: str, **options: Any) -> Simulator:
    """A simulator at the far end of one of these; options are those of `Simulator`."""
    if line == GOOD:
        return Simulator(**options)
    return ImpairedSimulator(load_profile(line), **options)
