"""Path error for the stages of the control loop, in virtual time: docs/control.md."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import output_folder, table
from support.control_quality import LAWS, PathPoint, figure_eight

CONDITIONS: dict[str, dict[str, float]] = {
    "as it is": {},
    "left motor 15 % weaker": {"left.motor_scale": 0.85},
    "0.02 N m on the left wheel": {"left.load_nm": 0.02},
}


def plot(paths: dict[tuple[str, str], list[PathPoint]], file: Path) -> None:
    """One panel per condition, one line per control law."""
    figure = Figure(figsize=(10, 3.4), layout="constrained")
    panels = figure.subplots(1, len(CONDITIONS), sharey=True)
    for axes, condition in zip(panels, CONDITIONS, strict=True):
        for law in LAWS:
            points = paths[law, condition]
            axes.plot([p.seconds for p in points], [p.distance_m * 1e3 for p in points], label=law)
        axes.set(title=condition, xlabel="time [s]", yscale="log", ylim=(0.3, 1000))
        axes.grid(alpha=0.3)
    panels[0].set_ylabel("path error [mm]")
    panels[0].legend(loc="lower right", fontsize="small")
    figure.savefig(file, dpi=110)


def main() -> None:
    """Print the table and plot it."""
    folder = output_folder(__doc__)
    paths = {
        (law, condition): figure_eight(parameters, **settings)
        for law, parameters in LAWS.items()
        for condition, settings in CONDITIONS.items()
    }
    plot(paths, folder / "path.png")
    rows = []
    for law, condition in paths:
        points = paths[law, condition]
        end = points[-1]
        worst = max(point.distance_m for point in points)
        turned = abs(math.degrees(end.heading_rad))
        row = [law, condition, f"{end.distance_m * 1e3:.1f} mm", f"{turned:.2f}"]
        rows.append([*row, f"{worst * 1e3:.1f} mm"])
    header = ("the loop", "condition", "end", "turned [deg]", "worst")
    sys.stdout.write(table(header, rows))


if __name__ == "__main__":
    main()
