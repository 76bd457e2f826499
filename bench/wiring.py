"""Set-ups of simulated robots: every wiring, and every defect that no parameter mends."""

from __future__ import annotations

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.defects import DEFECTS, named
from support.wiring_runs import cases, check


def main() -> int:
    """Print the figures; returns 1 if a wiring was not mended or a defect not named."""
    begin = time.monotonic()
    all_cases = list(cases())
    wrong = [(case, found) for case in all_cases if (found := check(case))]
    for case, found in wrong:
        sys.stdout.write(f"{case}: {'; '.join(found)}\n")
    seconds = time.monotonic() - begin
    sys.stdout.write(f"{len(all_cases)} set-ups, {len(wrong)} wrong, in {seconds:.0f} s\n\n")
    rows = [[defect.name, named(defect)] for defect in DEFECTS]
    sys.stdout.write(table(("the robot", "named"), rows))
    unnamed = [name for name, found in rows if not found]
    return int(bool(wrong or unnamed))


if __name__ == "__main__":
    sys.exit(main())
