"""How long the motors stay on when a process fails.

The application, or the process that moves the pins; median / longest, in ms.
"""

from __future__ import annotations

from harness import Report, run
from support.driver_bench.rig import busy
from support.process_failures import APPLICATION_FAILURES, CORE_FAILURES, time_failure

CORE_DRIVERS = ("pigpio", "l298n", "l298n, software PWM")
DRIVERS = ("serial", *CORE_DRIVERS, "mock")
PHASE_S = 0.0037
"""Spreads the failures over a control period and the time between two setpoints."""


def main(report: Report, *, runs: int = 20, others: int = 4, driver: str = "") -> None:
    """This many runs of each failure, while other processes occupy the cores."""
    rows = []
    with busy(others):
        for name in [driver] if driver else DRIVERS:
            of_core = CORE_FAILURES if name in CORE_DRIVERS else {}
            for failure in (*APPLICATION_FAILURES, *of_core):
                times = [time_failure(name, failure, run * PHASE_S) for run in range(runs)]
                late = [time.late_us for time in times]
                # The deadline says nothing where the drive was always removed before it, or where
                # one of the processes that keep it has failed.
                if failure in CORE_FAILURES or max(late) < 0:
                    late = []
                removed = _cell([time.failure_to_removed_us for time in times])
                ended = _cell([time.ended_us for time in times if time.ended_us is not None])
                rows.append(f"{name} | {failure} | {removed} | {_cell(late)} | {ended}")
    report.say(f"{runs} runs each, {others} busy processes:")
    report.table("driver | what died | to drive removed | after the deadline | to its end", rows)


def _cell(values_us: list[int]) -> str:
    ordered = sorted(values_us)
    if not ordered:
        return ""
    return f"{ordered[len(ordered) // 2] / 1000:.1f} / {ordered[-1] / 1000:.1f}"


run(main)
