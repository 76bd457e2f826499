"""The drivers.

The drivers are real; behind pigpio and l298n a stand-in in another process makes the edges, beside
0 or 4 busy processes. The firmware is its core in virtual time, up to {MOST_TPS} ticks a second. A
cell says how far the count is off, and the CPU of a core.
"""

from __future__ import annotations

from harness import Report, run
from support.driver_bench import firmware_rig
from support.driver_bench.rig import Counting, Timing, busy, gpio_rig, pigpio_rig

RATES_TPS = (1_000, 10_000, 60_000, 100_000, 250_000)
MOST_TPS = round(firmware_rig.LARGEST_TPS)
FIRMWARE_RATES_TPS = (1_000, 10_000, 100_000, MOST_TPS)
LOADS = (0, 4)
"""Numbers of busy processes during a run."""
BROKEN = 1e-3
"""Fraction of the ticks lost."""
SOURCE_KEEPS_UP = 0.85
"""Fraction of the requested rate; below it the stand-in is too slow to judge the driver."""


def cell(found: Counting) -> str:
    """How far a count is off, the transitions that were noticed, and the CPU."""
    noticed = f"{found.reported} noticed" if found.reported else ""
    cpu = f"{found.cpu:.0%}" if found.cpu else ""
    return ", ".join(filter(None, (f"{found.lost:.3%}", noticed, cpu)))


def timed(name: str, found: Timing) -> str:
    """A row of times."""
    late = sorted(found.stop_late_us)
    figures = (late[len(late) // 2], late[-1], found.period_us, found.worst_step_us)
    return " | ".join([name, *(f"{us / 1000:.1f}" for us in figures)])


def main(report: Report) -> None:
    """Measure and print."""
    # In virtual time, other processes make no difference: one series, without load.
    counts = {"firmware": [firmware_rig.count(rate) for rate in FIRMWARE_RATES_TPS]}
    times = [timed("firmware", firmware_rig.time_stops())]
    for open_rig in (pigpio_rig, gpio_rig):
        for load in LOADS:
            with busy(load), open_rig() as rig:
                name = f"{rig.name}, {load} busy"
                counts[name] = []
                times.append(timed(name, rig.time_stops()))
                for rate in RATES_TPS:
                    found = rig.count(rate)
                    if found.true_tps < SOURCE_KEEPS_UP * rate:
                        # This says nothing about the driver; neither would a higher rate.
                        break
                    counts[name].append(found)
                    if found.lost > BROKEN:
                        # Report it as the rate at which the driver fails; higher ones are worse.
                        break
    rows = []
    for rate in sorted({round(one.asked_tps) for of in counts.values() for one in of}):
        cells = [[cell(c) for c in of if round(c.asked_tps) == rate] for of in counts.values()]
        rows.append(" | ".join([f"{rate}", *map("; ".join, cells)]))
    report.table(" | ".join(["ticks/s a wheel", *counts]), rows)
    report.say(
        "In ms, from the setpoint's deadline to EN low (p50, worst), and between PWM updates "
        "(asked, worst):"
    )
    report.items(times)


run(main)
