"""Links per host.

All links in one process, a thread each; a simulator's process for each robot, on the same {CORES}
cores; {MEASURED_S:g} s each. CPU is the host's process, of one core; *round trip* the median of the
pings, of the median and of the worst link. A link wakes up for each frame
that a program reads, or every {REST_MS:g} ms.
"""

from __future__ import annotations

import os
import time
from contextlib import ExitStack
from statistics import median
from typing import NamedTuple

from harness import Report, run
from support.load import Load, frames_lost, load_while, read_for
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.port_policy import REST_US
from wheelwire.simulation.simulator import Simulator

CORES, REST_MS = os.cpu_count(), REST_US / 1e3
LINKS = (1, 4, 16)
LINK_HZ = 100
SETTLING_S = 0.3
MEASURED_S = 2.0


class Measured(NamedTuple):
    """What the links of a process cost, and their median round trips."""

    load: Load
    lost: int
    trips_us: list[float]


def measure(links: int) -> Measured:
    """Open the links, let them run, close them."""
    with ExitStack() as stack:
        simulators = [stack.enter_context(Simulator()) for _ in range(links)]
        robots = [
            stack.enter_context(SerialDriver(simulator.port, stream_rate_hz=LINK_HZ))
            for simulator in simulators
        ]
        # Opening the links does not count as load.
        time.sleep(SETTLING_S)
        before = [robot.statistics for robot in robots]
        load = load_while(lambda: read_for(MEASURED_S, robots[0], 0))
        after = [robot.statistics for robot in robots]
    lost = sum(map(frames_lost, before, after))
    return Measured(load, lost, [s.round_trip_p50_us for s in after])


def main(report: Report) -> None:
    """Measure and print; no frame may be lost."""
    many = {links: measure(links) for links in LINKS}
    report.table(
        f"links, {LINK_HZ} states/s each | CPU | wake-ups/s | round trip [us] | worst",
        [
            f"{links} | {of.load.cpu:.1%} | {of.load.wake_ups:.0f} | {median(of.trips_us):.0f} | "
            f"{max(of.trips_us):.0f}"
            for links, of in many.items()
        ],
    )
    report.equal("frames lost", sum(of.lost for of in many.values()), 0)


run(main)
