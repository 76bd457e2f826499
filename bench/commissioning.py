"""What the identification finds on the simulated plants against the truth; virtual time, 2 min."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, output_folder, table, table_of_targets
from support.commissioning import BATTERIES_V, PLANTS, Outcome, commission

HEADER = (
    "plant", "battery", "", "velocity_feedforward", "error", "static_feedforward", "error",
    "breakaway", "delay", "time constant", "RMS before", "after", "overshoot before", "after",
)  # fmt: skip
SLOPE, OFFSET, MEDIAN, WORST = 0.01, 0.05, 0.5, 1.0


def row(plant: str, raised: bool, outcome: Outcome) -> list[str]:
    """A line of the table."""
    found, proof = outcome.found, outcome.proof
    rms_before_mps, rms_after_mps = proof.rms_mps(0, 1)
    overshoot = [
        max(one or 0.0 for one in wheels)
        for wheels in zip(proof.overshoot(0), proof.overshoot(1), strict=True)
    ]
    return [
        plant,
        f"{found.supply_v:.2f} V",
        "raised" if raised else "on the floor",
        f"{found.velocity_feedforward:.4f}",
        f"{outcome.slope_error:+.2%}",
        f"{found.static_feedforward:.4f}",
        f"{outcome.offset_error:+.2%}",
        f"{found.left.breakaway:.3f}",
        f"{(found.delay_s or 0) * 1e3:.0f} ms",
        f"{(found.time_constant_s or 0) * 1e3:.0f} ms",
        f"{(rms_before_mps or 0) * 1e3:.1f} mm/s",
        f"{(rms_after_mps or 0) * 1e3:.1f}",
        *(f"{value:.0%}" for value in overshoot),
    ]


def targets(outcomes: Sequence[Outcome]) -> list[Target]:
    """What is claimed in docs/commissioning.md."""
    slope = max(abs(outcome.slope_error) for outcome in outcomes)
    offset = max(abs(outcome.offset_error) for outcome in outcomes)
    proved = [outcome.ratio for outcome in outcomes]
    true = [outcome.true_ratio for outcome in outcomes]
    return [
        Target("velocity_feedforward, worst error", f"{slope:.2%}", f"{SLOPE:.0%}", slope <= SLOPE),
        Target(
            "static_feedforward, worst error", f"{offset:.2%}", f"{OFFSET:.0%}", offset <= OFFSET
        ),
        *(
            Target(f"{name} after to before, {what}", f"{value:.2f}", f"{limit:g}", value <= limit)
            for name, ratios in (
                ("RMS as measured", proved),
                ("RMS of the true speed on the floor", true),
            )
            for what, value, limit in (
                ("median", median(ratios), MEDIAN),
                ("worst", max(ratios), WORST),
            )
        ),
    ]


def main() -> int:
    """Print the tables, plot one of the proofs; returns 1 if a target is missed."""
    folder = output_folder(__doc__)
    outcomes = {
        (plant, battery_v, raised): commission(plant, battery_v, raised=raised)
        for plant in PLANTS
        for battery_v in BATTERIES_V
        for raised in (True, False)
    }
    rows = [row(plant, raised, found) for (plant, _, raised), found in outcomes.items()]
    sys.stdout.write(table(HEADER, rows) + "\n")
    reached = targets(list(outcomes.values()))
    sys.stdout.write(table_of_targets(reached))
    outcomes["tt-1-48", 7.4, False].proof.plot(folder / "commissioning.png")
    return int(not all(target.reached for target in reached))


if __name__ == "__main__":
    sys.exit(main())
