"""Failing encoders, and hours of normal driving that must not trip a fault; in virtual time."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import table
from support.plausibility import fail, healthy


def _failures() -> list[list[str]]:
    rows = []
    for lost in (0.5, 0.7, 0.8, 0.9, 0.99):
        for target in (0.1, 0.2, 0.3):
            # To the firmware 0 V is a battery that is not measured.
            for battery, label in ((7.4, "yes"), (0.0, "no")):
                outcome = fail({"encoder_lost": lost}, "left", target, battery_v=battery)
                row = [f"{lost:.0%}", f"{target:g} m/s", label, f"{outcome.top_mps:.2f} m/s"]
                if outcome.faults:
                    row += [f"{outcome.seconds:.2f} s", f"{outcome.distance_m:.2f} m"]
                else:
                    row += ["no fault", ""]
                rows.append(row)
    return rows


def main() -> int:
    """Print the table; returns 1 if normal driving tripped a fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0, help="of driving, twice")
    hours = parser.parse_args().hours
    header = ("edges lost", "commanded", "battery measured", "top speed", "fault after", "rolled")
    sys.stdout.write(table(header, _failures()))
    trips = [trip for measured in (True, False) for trip in healthy(3600 * hours, 2, measured)]
    sys.stdout.write(f"\n{2 * hours:g} h of ordinary driving: {len(trips)} faults {trips}\n")
    return int(bool(trips))


if __name__ == "__main__":
    sys.exit(main())
