"""Explore the whole robot from one seed: `make explore [SECONDS=60] [SEED=N]`."""

from __future__ import annotations

import argparse
import secrets
import subprocess
import sys
from itertools import groupby
from pathlib import Path

from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))
from support import exploring

CONSOLE = Console(markup=False, highlight=False, soft_wrap=True)
TITLES = {"transition": ("state", "event"), "refusal": ("message", "refusal")}


def commit() -> str:
    """The commit that is explored, with a mark if there are changes on top of it."""
    command = ["git", "-C", str(exploring.ROOT), "describe", "--always", "--dirty", "--abbrev=12"]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    return result.stdout.strip() or "unknown"


def table(name: str, cells: dict[str, int]) -> Table:
    """What was seen together with what, and how often."""
    listed = Table(*TITLES[name], title=name)
    for row, seen in groupby(sorted(cells.items()), key=lambda cell: cell[0].split(" ")[0]):
        listed.add_row(row, ", ".join(f"{cell.split(' ')[1]} {n}" for cell, n in seen))
    return listed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seconds", type=float, help="of each of two processes' processor time")
    parser.add_argument("seed", type=int, nargs="?", help="the first; default: one by chance")
    parser.add_argument("--quiet", action="store_true", help="no tables of what was reached")
    parser.add_argument("--shrink", default="60", metavar="SECONDS", help="for at most so long")
    options = parser.parse_args()
    seed = options.seed if options.seed is not None else secrets.randbits(48)
    CONSOLE.print(f"seeds from {seed}, commit {commit()}")
    report = exploring.explore(seed, seconds=options.seconds, options=["--shrink", options.shrink])
    if not options.quiet:
        wide = Console(markup=False, highlight=False, width=200)
        for name, cells in report.cells.items():
            wide.print(table(name, cells))
    CONSOLE.print(
        f"{report.totals['scenarios']:.0f} scenarios, "
        f"{report.totals['robot seconds'] / 3600:.1f} hours of the robot, "
        f"{report.hours_per_cpu_minute:.1f} in a minute of one processor"
    )
    for what, where in report.broken:
        CONSOLE.print(f"BROKEN {what} ({where}, commit {commit()})")
    for file in report.files:
        shown = file.relative_to(exploring.ROOT)
        CONSOLE.print(file.read_text("utf-8"))
        CONSOLE.print(f"as a test: cp {shown} tests/explore/cases/")
    return 1 if report.broken else 0


if __name__ == "__main__":
    sys.exit(main())
