"""Wheels that fail, and sound robots, at every duty limit.

In virtual time.
"""

from __future__ import annotations

from collections import defaultdict
from random import Random

from harness import Report, run
from support.duty_limit import Failure, detect, healthy, is_in_time, matrix
from support.plausibility import Outcome


def main(report: Report, *, hours: float = 1.0, share: float = 1.0, seed: int = 1) -> None:
    """Print the table; no failure may be missed, and no sound robot trip."""
    cases = list(matrix())
    chosen = sorted(Random(seed).sample(range(len(cases)), round(share * len(cases))))
    groups: dict[str, list[tuple[Failure, Outcome]]] = defaultdict(list)
    for case in (cases[number] for number in chosen):
        speed = "below 0.1 m/s" if abs(case.setpoint[0]) < 0.1 else "0.1 m/s or more"
        groups[f"{case.what} | {speed}"].append((case, detect(case)))
    rows, missed = [], []
    for name, group in groups.items():
        late = [run for run in group if not is_in_time(*run)]
        missed += late
        tripped = [detection for _, detection in group if detection.faults]
        rows.append(
            f"{name} | {len(group)} | {len(late)} | {max(t.at_limit_s for t in tripped):.2f} s | "
            f"{max(t.seconds for t in tripped):.2f} s | {max(t.distance_m for t in tripped):.2f} m"
        )
    report.table(
        "failure | setpoint | runs | missed | after the limit | after the setpoint | rolled", rows
    )
    trips = healthy(3600 * hours, seed)
    for one in (*missed, *trips):
        report.say(f"- {one}")
    report.equal("failures missed", len(missed), 0)
    report.equal(f"faults in {hours:g} h of sound robots at their limit", len(trips), 0)


run(main)
