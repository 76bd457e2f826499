"""Path error for the stages of the control loop.

In virtual time; also a picture.
"""

from __future__ import annotations

import math
from itertools import product

from matplotlib.figure import Figure

from harness import Report, run
from support.control_quality import LAWS, figure_eight

CONDITIONS: dict[str, dict[str, float]] = {
    "as it is": {},
    "left motor 15 % weaker": {"left.motor_scale": 0.85},
    "0.02 N m on the left wheel": {"left.load_nm": 0.02},
}


def main(report: Report) -> None:
    """Print the table, and plot a panel for each condition."""
    figure, rows = Figure(figsize=(10, 3.4), layout="constrained"), []
    panels = dict(zip(CONDITIONS, figure.subplots(1, len(CONDITIONS), sharey=True), strict=True))
    for (law, parameters), (condition, settings) in product(LAWS.items(), CONDITIONS.items()):
        points = figure_eight(parameters, **settings)
        away_mm = [point.distance_m * 1e3 for point in points]
        turned = abs(math.degrees(points[-1].heading_rad))
        rows.append(
            f"{law} | {condition} | {away_mm[-1]:.1f} mm | {turned:.2f} | {max(away_mm):.1f} mm"
        )
        axes = panels[condition]
        axes.plot([point.seconds for point in points], away_mm, label=law)
        axes.set(title=condition, xlabel="time [s]", yscale="log", ylim=(0.3, 1000))
        axes.grid(alpha=0.3)
    panels["as it is"].set_ylabel("path error [mm]")
    panels["as it is"].legend(loc="lower right", fontsize="small")
    figure.savefig(report.folder / "path.png", dpi=110)
    report.table("the loop | condition | end | turned [deg] | worst", rows)


run(main)
