"""Failing encoders, and hours of ordinary driving that must not trip a fault.

In virtual time.
"""

from __future__ import annotations

from itertools import product

from harness import Report, run
from support.plausibility import fail, healthy

# To the firmware, 0 V means that the battery is not measured.
BATTERIES_V = {7.4: "yes", 0.0: "no"}


def main(report: Report, *, hours: float = 1.0) -> None:
    """Print the table; ordinary driving must not trip a fault."""
    rows = []
    for lost, mps, battery_v in product((0.5, 0.7, 0.8, 0.9, 0.99), (0.1, 0.2, 0.3), BATTERIES_V):
        found = fail({"encoder_lost": lost}, "left", mps, battery_v=battery_v)
        after = (
            f"{found.seconds:.2f} s | {found.distance_m:.2f} m" if found.faults else "no fault | "
        )
        measured = BATTERIES_V[battery_v]
        rows.append(f"{lost:.0%} | {mps:g} m/s | {measured} | {found.top_mps:.2f} m/s | {after}")
    report.table(
        "edges lost | commanded | battery measured | top speed | fault after | rolled", rows
    )
    trips = [trip for measured in (True, False) for trip in healthy(3600 * hours, 2, measured)]
    report.say("".join(f"- {trip}\n" for trip in trips) or "Nothing tripped.")
    report.equal(f"faults in {2 * hours:g} h of ordinary driving", len(trips), 0)


run(main)
