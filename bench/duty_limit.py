"""Wheels that fail and sound robots, at every duty limit; in virtual time."""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.duty_limit import Detection, Failure, detect, healthy, is_in_time, matrix


def _rows(found: list[tuple[Failure, Detection]]) -> list[list[str]]:
    groups: dict[tuple[str, str], list[tuple[Failure, Detection]]] = defaultdict(list)
    for failure, detection in found:
        slow = abs(failure.setpoint[0]) < 0.1
        groups[failure.what, "below 0.1 m/s" if slow else "0.1 m/s or more"].append(
            (failure, detection)
        )
    rows = []
    for (what, speed), group in groups.items():
        tripped = [detection for _, detection in group if detection.faults]
        rows.append(
            [
                what,
                speed,
                str(len(group)),
                str(sum(not is_in_time(*run) for run in group)),
                f"{max(one.at_limit_s for one in tripped):.2f} s",
                f"{max(one.seconds for one in tripped):.2f} s",
                f"{max(one.distance_m for one in tripped):.2f} m",
            ]
        )
    return rows


def main() -> int:
    """Print the table; returns 1 if a failure was missed or a sound robot tripped."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0, help="of sound robots")
    parser.add_argument("--share", type=float, default=1.0, help="of the matrix of failures")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    cases = list(matrix())
    chosen = set(
        Random(arguments.seed).sample(range(len(cases)), round(arguments.share * len(cases)))
    )
    found = [(case, detect(case)) for number, case in enumerate(cases) if number in chosen]
    header = (
        "failure",
        "setpoint",
        "runs",
        "missed",
        "after the limit",
        "after the setpoint",
        "rolled",
    )
    sys.stdout.write(table(header, _rows(found)))
    missed = [run for run in found if not is_in_time(*run)]
    for run in missed:
        sys.stdout.write(f"missed: {run}\n")
    trips = healthy(3600 * arguments.hours, arguments.seed)
    sys.stdout.write(
        f"\n{arguments.hours:g} h of sound robots at their limit: {len(trips)} faults {trips}\n"
    )
    return int(bool(missed or trips))


if __name__ == "__main__":
    sys.exit(main())
