"""Recordings that end by kills and power cuts: `.venv/bin/python bench/recording_crashes.py`.

Each is repaired and read: no record may be another than the link's, and none older than the last
second may be missing.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.crashes import day, folder_in_memory, kills, power_cuts, prefixes, short_file


def main() -> int:
    """Run, print, and fail if anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--cuts", type=int, default=200)
    parser.add_argument("--step", type=int, default=1, help="between two prefixes [bytes]")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    problems = []
    with folder_in_memory() as folder:
        killed = list(kills(arguments.kills, arguments.seed, folder))  # first: it forks
        problems += [f"killed after {one.after_s:.3f} s: {one.problem}" for one in killed]
        path, moments = day(folder)
        cuts = list(power_cuts(arguments.cuts, arguments.seed, path, moments))
        problems += [f"cut at {one.written}, {one.synced} synced: {one.problem}" for one in cuts]
        lengths = list(prefixes(short_file(folder), arguments.step))
        problems += [f"ended at {length}: {problem}" for length, problem in lengths]
    rows = [
        ["kill -9 at a random moment", str(len(killed)),
         f"{sum(one.recorded for one in killed)} records",
         f"{max((one.lost_s for one in killed), default=0):.2f} s"],
        ["power cut, some unsynced pages on the disk", str(len(cuts)),
         f"{sum(one.recorded for one in cuts)} records", "nothing that was synced"],
        ["file that ends at a byte", str(len(lengths)), "each chunk that is whole", ""],
    ]  # fmt: skip
    sys.stdout.write(table(("recordings", "number", "read again", "most that was lost"), rows))
    wrong = [problem for problem in problems if not problem.endswith(": ")]
    sys.stdout.write("".join(f"{problem}\n" for problem in wrong) or "\nnothing wrong\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
