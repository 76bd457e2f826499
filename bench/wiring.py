"""Set-ups of simulated robots.

Every wiring, and every defect that no parameter mends; in virtual time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from harness import Report, run
from support.defects import DEFECTS, named
from support.wiring_runs import Case, between_corners, cases, check, check_wiring, corners

SEED, BETWEEN = 5, 1000
TRIED: dict[str, tuple[Callable[[Case], list[str]], Iterable[Case]]] = {
    "set-ups with motors as they should be": (check, cases()),
    "wirings at the corners of supply, friction and play": (check_wiring, corners()),
    "wirings between the corners": (check_wiring, between_corners(SEED, BETWEEN)),
}


def main(report: Report) -> None:
    """Print the figures; each wiring must be mended, and each defect named."""
    for title, (judge, robots) in TRIED.items():
        found = [(case, judge(case)) for case in robots]
        wrong = [f"{case}: {'; '.join(words)}" for case, words in found if words]
        report.say("\n".join([f"{len(found)} {title}: {len(wrong)} wrong", *wrong]))
        report.equal(f"wrong: {title}", len(wrong), 0)
    names = {defect.name: named(defect) for defect in DEFECTS}
    report.table("the robot | named", [f"{robot} | {name}" for robot, name in names.items()])
    report.equal("defects that were not named", sum(not name for name in names.values()), 0)


run(main)
