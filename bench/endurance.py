"""Resets and unpluggings while driving.

In virtual time, with a state in each control step.
"""

from __future__ import annotations

from harness import Report, run, three
from support.endurance import across_the_tick_wrap, across_the_time_wrap, drive_and_interrupt

CYCLES = 100
"""Interruptions in one run; each run has its own robot."""


def main(report: Report, *, cycles: int = 4000) -> None:
    """Print the tables; no tick may be unaccounted for, and no pose jump."""
    runs = [drive_and_interrupt(CYCLES, seed) for seed in range(1, cycles // CYCLES + 1)]
    resets = sum(run.resets for run in runs)
    accounts = {
        f"{resets} resets and {len(runs) * CYCLES - resets} unpluggings": [
            r.finish() for r in runs
        ],
        "the 32-bit time wraps": [across_the_time_wrap(1).finish()],
        "the 32-bit ticks wrap": [across_the_tick_wrap(1).finish()],
    }
    rows = []
    for name, found in accounts.items():
        wrong, jumps = sum(one.wrong for one in found), sum(one.jumps for one in found)
        unaccounted = sum(abs(one.unaccounted) for one in found)
        samples = sum(one.samples for one in found)
        rows.append(f"{name} | {samples} | {wrong} | {unaccounted} | {jumps}")
        report.equal(f"wrong, unaccounted, jumps: {name}", wrong + unaccounted + jumps, 0)
    report.table("run | samples | wrong ticks | unaccounted ticks | jumps of the pose", rows)
    unseen = [unseen for one in next(iter(accounts.values())) for unseen in one.unseen]
    hidden = three([one.milliseconds for one in unseen], " ms")
    report.say(f"unseen at a reset: {hidden}")
    report.say(f"driven unseen: {three([abs(one.distance_m) * 1e3 for one in unseen], ' mm')}")


run(main)
