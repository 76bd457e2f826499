"""Stop times after every kind of link loss.

Measured on the plant: p50 / p99 / max, with a time to live of {TTL_S:g} s.
"""

from __future__ import annotations

from harness import Report, run, three
from support.stop_host import FAILURES as REAL_FAILURES
from support.stop_host import real_stop_time
from support.stop_times import FAILURES, PERIOD_US, TTL_S, StopTime, stop_time  # noqa: F401 - the section has it

HEADER = (
    "what happened | deadline to drive removed | failure to drive removed | "
    "drive removed to standstill | distance"
)


def show(report: Report, title: str, found: dict[str, list[StopTime]]) -> None:
    """Print a table."""
    rows, longest_us = [], 0.0
    for name, times in found.items():
        # A reset knows no deadline, and has to end the drive by itself.
        late = [time.late_us for time in times if time.late_us is not None]
        removed = [time.failure_to_removed_us for time in times]
        longest_us = max(longest_us, *(late or removed))
        stood = [time.removed_to_standstill_us / 1e3 for time in times]
        cells = (
            three([us / 1e3 for us in late], " ms") if late else "at once",
            three([us / 1e3 for us in removed], " ms"),
            three(stood, " ms"),
            three([time.distance_m * 1e3 for time in times], " mm"),
        )
        rows.append(" | ".join([name, *cells]))
    report.say(f"{title}:")
    report.table(HEADER, rows)
    report.at_most(f"removed after the deadline, {title}", longest_us / 1e3, PERIOD_US / 1e3, " ms")


def main(report: Report, *, virtual: int = 100, real: int = 5) -> None:
    """Print the tables; no drive may be removed too late."""
    seen = {
        name: [stop_time(how, seed) for seed in range(virtual)] for name, how in FAILURES.items()
    }
    show(report, f"{virtual} runs each in virtual time", seen)
    for watched, title in ((False, "in real time"), (True, "in real time, recorded, attached")):
        seen = {
            name: [real_stop_time(name, seed, watched=watched) for seed in range(1, real + 1)]
            for name in (*REAL_FAILURES, "device reset")
        }
        show(report, f"{real} runs each {title}", seen)


run(main)
