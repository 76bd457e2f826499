"""Recordings that end by kills and power cuts.

Each is repaired and read: no record may be another than the link's, and none older than the last
second may be missing.
"""

from __future__ import annotations

from harness import Report, run
from support.crashes import day, folder_in_memory, power_cuts, prefixes, short_file
from support.crashes import kills as killed_files


def main(
    report: Report, *, kills: int = 200, cuts: int = 200, step: int = 1, seed: int = 1
) -> None:
    """Print what was read again; `step` is the distance between two prefixes, in bytes."""
    with folder_in_memory() as folder:
        killed = list(killed_files(kills, seed, folder))  # first: it forks
        path, moments = day(folder)
        cut = list(power_cuts(cuts, seed, path, moments))
        lengths = list(prefixes(short_file(folder), step))
    every = (*killed, *cut, *lengths)
    problems = [f"{one.what}: {one.problem}" for one in every if one.problem]
    lost_s = max((one.lost_s for one in killed), default=0)
    rows = [
        f"kill -9 at a random moment | {len(killed)} | "
        f"{sum(one.recorded for one in killed)} records | {lost_s:.2f} s",
        f"power cut, some unsynced pages on the disk | {len(cut)} | "
        f"{sum(one.recorded for one in cut)} records | nothing that was synced",
        f"file that ends at a byte | {len(lengths)} | each chunk that is whole | ",
    ]
    report.table("recordings | number | read again | most that was lost", rows)
    for problem in problems:
        report.say(problem)
    report.equal("recordings that are wrong", len(problems), 0)


run(main)
