"""Set-ups of simulated robots: every wiring, and every defect that no parameter mends."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.defects import DEFECTS, named
from support.wiring_runs import Case, between_corners, cases, check, check_wiring, corners

SEED = 5
BETWEEN = 1000


def main() -> int:
    """Print the figures; returns 1 if a wiring was not mended or a defect not named."""
    wrong = _tried("set-ups with motors as they should be", check, cases())
    wrong += _tried("wirings at the corners of supply, friction and play", check_wiring, corners())
    between = between_corners(SEED, BETWEEN)
    wrong += _tried("wirings between the corners", check_wiring, between)
    sys.stdout.write("\n")
    rows = [[defect.name, named(defect)] for defect in DEFECTS]
    sys.stdout.write(table(("the robot", "named"), rows))
    unnamed = [name for name, found in rows if not found]
    return int(bool(wrong or unnamed))


def _tried(title: str, judge: Callable[[Case], list[str]], cases: Iterable[Case]) -> int:
    """How many were wrong; each is printed."""
    begin = time.process_time()
    count = wrong = 0
    for count, case in enumerate(cases, 1):  # noqa: B007
        if found := judge(case):
            wrong += 1
            sys.stdout.write(f"{case}: {'; '.join(found)}\n")
    seconds = time.process_time() - begin
    sys.stdout.write(f"{count} {title}: {wrong} wrong, {seconds:.0f} s of CPU\n")
    sys.stdout.flush()
    return wrong


if __name__ == "__main__":
    sys.exit(main())
