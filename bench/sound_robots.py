"""What sound robots reach in setup's test drive, and robots that miss a magnet; virtual time.

Takes three minutes. Setup compares with the formula of `wheelwire.tools.setup.expectation`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.commissioning import PLANTS, Tracking, tracking
from wheelwire.tools.setup.expectation import BEYOND

COUNTS = (20, 48, 96, 144, 360, 1440)
HEADER = ("ticks per turn", "formula", "sound", "one magnet missing", "named from")


def robots(counts: int, **settings: float) -> list[Tracking]:
    """Of each plant, raised and on the floor."""
    return [
        tracking(plant, counts, raised=raised, settings=settings)
        for plant in PLANTS
        for raised in (True, False)
    ]


def reached(found: Sequence[Tracking]) -> str:
    """The least and the most tracking error of the right wheel."""
    errors = [one.rms_mps[1] * 1e3 for one in found]
    return f"{min(errors):.0f} to {max(errors):.0f}"


def main() -> None:
    """Print the table; all in mm/s."""
    rows = []
    for counts in COUNTS:
        sound = robots(counts)
        formula = max(one.expected_mps for one in sound) * 1e3
        damaged = robots(counts, **{"right.magnet_missing": 1.0})
        row = (f"{formula:.0f}", reached(sound), reached(damaged), f"{BEYOND * formula:.0f}")
        rows.append([str(counts), *row])
    sys.stdout.write(table(HEADER, rows) + "\n")


if __name__ == "__main__":
    main()
