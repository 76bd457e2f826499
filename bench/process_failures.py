"""How long the motors stay on when the application, or the process that moves the pins, fails.

Usage: python bench/process_failures.py [RUNS [BUSY [DRIVER...]]]: RUNS of each, beside BUSY
processes that occupy the cores.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.benchmark import table
from support.driver_bench.rig import busy
from support.process_failures import APPLICATION_FAILURES, CORE_FAILURES, FailureTimes, time_failure

DRIVERS = ("serial", "pigpio", "l298n", "l298n, software PWM", "mock")
CORE_DRIVERS = ("pigpio", "l298n", "l298n, software PWM")
PHASE_S = 0.0037
"""So that the failures are spread over a control period and the time between two setpoints."""


def main() -> None:
    """See the module."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    processes = int(sys.argv[2]) if len(sys.argv) > 2 else 4
    drivers = sys.argv[3:] or DRIVERS
    rows = []
    with busy(processes):
        for driver in drivers:
            failures = [*APPLICATION_FAILURES, *(CORE_FAILURES if driver in CORE_DRIVERS else ())]
            for failure in failures:
                times = [time_failure(driver, failure, run * PHASE_S) for run in range(runs)]
                rows.append([driver, failure, *_cells(times, failure)])
                # At once, for whoever waits: the table comes at the very end.
                sys.stderr.write(" | ".join(rows[-1]) + "\n")
    title = f"{runs} runs each, {processes} busy processes; median / longest, ms"
    header = ("driver", "what died", "to drive removed", "after the deadline", "to its end")
    sys.stdout.write(f"{title}\n\n{table(header, rows)}")


def _cells(times: list[FailureTimes], failure: str) -> tuple[str, str, str]:
    late = [t.late_us for t in times]
    ended = [t.ended_us for t in times if t.ended_us is not None]
    # The deadline says nothing where the drive was always removed before it, or where one of the
    # processes that keep it has failed.
    return (
        _cell([t.failure_to_removed_us for t in times]),
        "" if failure in CORE_FAILURES or max(late) < 0 else _cell(late),
        _cell(ended) if ended else "",
    )


def _cell(values_us: list[int]) -> str:
    ordered = sorted(values_us)
    return f"{ordered[len(ordered) // 2] / 1000:.1f} / {ordered[-1] / 1000:.1f}"


if __name__ == "__main__":
    main()
