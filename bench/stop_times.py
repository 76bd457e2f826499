"""Stop times after every kind of link loss, measured on the plant: `make reliability`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support import stop_host, stop_times
from support.benchmark import spread, table
from support.stop_times import FAILURES, PERIOD_US, TTL_S, StopTime

COLUMNS = (
    "deadline to drive removed",
    "failure to drive removed",
    "drive removed to standstill",
    "distance",
)


def row(times: list[StopTime]) -> tuple[str, ...]:
    """The cells of `COLUMNS`: p50 / p99 / max."""
    late = [time.late_us / 1e3 for time in times if time.late_us is not None]
    return (
        _cell(late, "ms") if late else "at once",
        _cell([time.failure_to_removed_us / 1e3 for time in times], "ms"),
        _cell([time.removed_to_standstill_us / 1e3 for time in times], "ms"),
        _cell([time.distance_m * 1e3 for time in times], "mm"),
    )


def in_time(time: StopTime) -> bool:
    """Whether the drive was removed within one control period."""
    # A reset knows no deadline, and has to end the drive by itself.
    late = time.failure_to_removed_us if time.late_us is None else time.late_us
    return late <= PERIOD_US


def main() -> int:
    """Print the tables; fail if a drive was removed too late."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--virtual", type=int, default=100, help="runs in virtual time")
    parser.add_argument("--real", type=int, default=5, help="runs in real time")
    arguments = parser.parse_args()
    virtual = {
        name: [stop_times.stop_time(failure, seed) for seed in range(arguments.virtual)]
        for name, failure in FAILURES.items()
    }
    _print(f"{arguments.virtual} runs each in virtual time", virtual)
    real = _real(arguments.real, watched=False)
    _print(f"{arguments.real} runs each in real time", real)
    watched = _real(arguments.real, watched=True)
    _print(f"{arguments.real} runs each in real time, recorded, a program attached", watched)
    runs = (virtual, real, watched)
    late = [time for run in runs for times in run.values() for time in times]
    return 0 if all(in_time(time) for time in late) else 1


def _real(runs: int, *, watched: bool) -> dict[str, list[StopTime]]:
    return {
        name: [stop_host.real_stop_time(name, seed, watched=watched) for seed in range(1, runs + 1)]
        for name in (*stop_host.FAILURES, "device reset")
    }


def _print(title: str, times: dict[str, list[StopTime]]) -> None:
    limit = f"ttl {TTL_S:g} s, target: removed at most {PERIOD_US / 1e3:g} ms after the deadline"
    rows = [[name, *row(measured)] for name, measured in times.items()]
    found = table(("what happened", *COLUMNS), rows)
    sys.stdout.write(f"{title} (p50 / p99 / max; {limit})\n\n{found}\n")


def _cell(values: list[float], unit: str) -> str:
    return " / ".join(f"{number:.1f}" for number in spread(values)) + f" {unit}"


if __name__ == "__main__":
    sys.exit(main())
