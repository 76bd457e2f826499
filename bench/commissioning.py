"""What the identification finds on the simulated plants, against the truth.

In virtual time, two minutes.
"""

from __future__ import annotations

from itertools import product
from statistics import median

from harness import Report, run
from support.commissioning import BATTERIES_V, PLANTS, Outcome, commission

HEADER = (
    "plant | battery |  | velocity_feedforward | error | static_feedforward | error | breakaway | "
    "delay | time constant | RMS before | after | overshoot before | after"
)
SLOPE, OFFSET, MEDIAN, WORST = 0.01, 0.05, 0.5, 1.0


def row(plant: str, raised: bool, outcome: Outcome) -> str:
    """A line of the table."""
    found, proof = outcome.found, outcome.proof
    before_mps, after_mps = ((mps or 0) * 1e3 for mps in proof.rms_mps(0, 1))
    before, after = (
        max(one or 0.0 for one in wheels)
        for wheels in zip(proof.overshoot(0), proof.overshoot(1), strict=True)
    )
    return (
        f"{plant} | {found.supply_v:.2f} V | {'raised' if raised else 'on the floor'} | "
        f"{found.velocity_feedforward:.4f} | {outcome.slope_error:+.2%} | "
        f"{found.static_feedforward:.4f} | {outcome.offset_error:+.2%} | "
        f"{found.left.breakaway:.3f} | {(found.delay_s or 0) * 1e3:.0f} ms | "
        f"{(found.time_constant_s or 0) * 1e3:.0f} ms | {before_mps:.1f} mm/s | {after_mps:.1f} | "
        f"{before:.0%} | {after:.0%}"
    )


def main(report: Report) -> None:
    """Print the tables, plot one of the proofs."""
    outcomes = {
        (plant, battery_v, raised): commission(plant, battery_v, raised=raised)
        for plant, battery_v, raised in product(PLANTS, BATTERIES_V, (True, False))
    }
    report.table(HEADER, [row(plant, raised, o) for (plant, _, raised), o in outcomes.items()])
    every = list(outcomes.values())
    slope = max(abs(one.slope_error) for one in every)
    offset = max(abs(one.offset_error) for one in every)
    report.at_most("velocity_feedforward, worst error", 100 * slope, 100 * SLOPE, " %")
    report.at_most("static_feedforward, worst error", 100 * offset, 100 * OFFSET, " %")
    for name, ratios in (
        ("RMS as measured", [one.ratio for one in every]),
        ("RMS of the true speed on the floor", [one.true_ratio for one in every]),
    ):
        report.at_most(f"{name} after to before, median", median(ratios), MEDIAN)
        report.at_most(f"{name} after to before, worst", max(ratios), WORST)
    outcomes["tt-1-48", 7.4, False].proof.plot(report.folder / "commissioning.png")


run(main)
