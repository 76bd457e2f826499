"""Endurance on a bad line.

In real time: {STATE_HZ} states a second, {PERCENT:g} % of all bytes corrupted.
"""

from __future__ import annotations

from statistics import median

from harness import Report, run
from support.soak import CORRUPT, STATE_HZ, Lap  # noqa: F401 - the section has it
from support.soak import run as laps_of
from wheelwire.link.statistics import quantile

PERCENT = 100 * CORRUPT
GROWTH_KIB = 4096
"""Memory growth from the second to the last third, up to which it counts as constant."""


def growth_kib(laps: list[Lap], process: int) -> int:
    """Growth of the memory from the second third of the run to the last, by medians."""
    # The first third is left out: buffers and caches still fill up then.
    third = max(1, len(laps) // 3)
    resident = [lap.resident_kib[process] for lap in laps]
    return round(median(resident[-third:]) - median(resident[third:-third]))


def main(report: Report, *, minutes: float = 2.0) -> None:
    """Run, and print what was measured."""
    laps = laps_of(minutes)
    resets = sum(lap.incident == "reset" for lap in laps)
    for what, number in (
        ("frames given to the line", sum(lap.frames for lap in laps)),
        ("... lost or damaged there", sum(lap.hit for lap in laps)),
        ("setpoints that came too late", laps[-1].expired),  # each lap has the sum so far
        ("resets, unpluggings", f"{resets}, {len(laps) - resets}"),
    ):
        report.target(what, number, "", reached=True)
    uncounted = sum(abs(number) for lap in laps for number in lap.uncounted)
    report.equal("... of which are in no counter", uncounted, 0)
    report.equal("ticks lost or invented", sum(abs(lap.ticks_wrong) for lap in laps), 0)
    report.equal("sessions lost without an incident", sum(lap.sessions for lap in laps), 0)
    for incident in ("reset", "unplug"):
        times = [lap.recovery_s for lap in laps if lap.incident == incident]
        found = f"p50 {quantile(times, 0.5):.3f} s, max {max(times, default=0):.3f} s"
        report.target(f"recovered from {incident}", found, "", reached=True)
    for process, name in enumerate(("host", "simulator")):
        report.at_most(f"growth of the {name}", growth_kib(laps, process), GROWTH_KIB, " KiB")
    for name in ("threads", "files"):
        counts = sorted({getattr(lap, name) for lap in laps})
        report.target(f"{name} of the host", counts, "one number", len(counts) == 1)


run(main, log_level="ERROR")
