"""What sound robots reach in setup's test drive, and robots that miss a magnet.

In virtual time, three minutes; all in mm/s. Setup compares with the formula of
`wheelwire.tools.setup.expectation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from harness import Report, run
from support.commissioning import PLANTS, Tracking, tracking
from wheelwire.tools.setup.expectation import BEYOND

COUNTS = (20, 48, 96, 144, 360, 1440)


def robots(counts: int, **settings: float) -> list[Tracking]:
    """Runs of each plant, raised and on the floor."""
    kinds = product(PLANTS, (True, False))
    return [tracking(plant, counts, raised=raised, settings=settings) for plant, raised in kinds]


def reached(found: Sequence[Tracking]) -> str:
    """The least and the most tracking error of the right wheel."""
    errors = [one.rms_mps[1] * 1e3 for one in found]
    return f"{min(errors):.0f} to {max(errors):.0f}"


def main(report: Report) -> None:
    """Print the table."""
    rows = []
    for counts in COUNTS:
        sound, damaged = robots(counts), robots(counts, **{"right.magnet_missing": 1.0})
        formula = max(one.expected_mps for one in sound) * 1e3
        rows.append(
            f"{counts} | {formula:.0f} | {reached(sound)} | {reached(damaged)} | "
            f"{BEYOND * formula:.0f}"
        )
    report.table("ticks per turn | formula | sound | one magnet missing | named from", rows)


run(main)
