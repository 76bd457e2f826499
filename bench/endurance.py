"""Thousands of resets and unpluggings while driving, in virtual time: `make reliability`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import spread, table
from support.endurance import (
    Account,
    across_the_tick_wrap,
    across_the_time_wrap,
    drive_and_interrupt,
)

CYCLES = 100
"""Interruptions in one run; each run has its own robot."""


def main() -> int:
    """Print the tables; fail if a tick is unaccounted for or a pose jumps."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=4000, help="resets and unpluggings")
    arguments = parser.parse_args()
    runs = [drive_and_interrupt(CYCLES, seed) for seed in range(1, arguments.cycles // CYCLES + 1)]
    accounts = {
        "resets and unpluggings": [run.finish() for run in runs],
        "the 32-bit time wraps": [across_the_time_wrap(1).finish()],
        "the 32-bit ticks wrap": [across_the_tick_wrap(1).finish()],
    }
    header = ("run", "samples", "wrong ticks", "unaccounted", "jumps of the pose")
    rows = [[name, *map(str, _sums(of_case))] for name, of_case in accounts.items()]
    sys.stdout.write(f"{table(header, rows)}\n")
    unseen = [unseen for account in accounts["resets and unpluggings"] for unseen in account.unseen]
    resets = sum(run.resets for run in runs)
    sys.stdout.write(f"{resets} resets, {len(runs) * CYCLES - resets} unpluggings\n")
    for name, values in (
        ("unseen at a reset, ms", [one.milliseconds for one in unseen]),
        ("driven unseen at a reset, mm", [abs(one.distance_m) * 1e3 for one in unseen]),
    ):
        numbers = " / ".join(f"{number:.1f}" for number in spread(values))
        sys.stdout.write(f"{name}: {numbers}\n")
    return int(any(any(_sums(of_case)[1:]) for of_case in accounts.values()))


def _sums(accounts: list[Account]) -> tuple[int, int, int, int]:
    return (
        sum(account.samples for account in accounts),
        sum(account.wrong for account in accounts),
        sum(abs(account.unaccounted) for account in accounts),
        sum(account.jumps for account in accounts),
    )


if __name__ == "__main__":
    sys.exit(main())
