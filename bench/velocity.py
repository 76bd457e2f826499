"""Error and noise of the measured velocity over speed: docs/control.md."""

from __future__ import annotations

import csv
import math
import subprocess
import sys
from pathlib import Path

from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import ROOT, output_folder, table

PROGRAM = ROOT / "build" / "host" / "wheelwire-velocity-curve"
DEFAULT_HZ = 1000
"""The control rate for the plot."""
TARGETS = {100: 0.003, 200: 0.003, 500: 0.002, DEFAULT_HZ: 0.002}
"""Target for the mean's error, by control rate. [Hz]"""

Rows = list[dict[str, float]]


def run(rate_hz: int) -> Rows:
    """The program's rows at a control rate; up to half a minute."""
    command = [str(PROGRAM), str(rate_hz)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return [
        {name: float(value) for name, value in row.items()}
        for row in csv.DictReader(lines.splitlines())
    ]


def plot(rows: Rows, file: Path) -> None:
    """The mean's error above, the noise below; both directions."""
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    panels = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, counts in enumerate((360, 1440)):
        chosen = [row for row in rows if row["counts_per_revolution"] == counts]
        speeds = [row["mps"] for row in chosen]
        for line, what in enumerate(("mean_error", "noise")):
            axes = panels[line][column]
            for name, label in ((f"obvious_{what}", "tick to tick"), (what, "Wheelwire")):
                axes.plot(speeds, [row[name] * 100 for row in chosen], label=label, linewidth=0.9)
            axes.grid(alpha=0.3)
        panels[0][column].set_title(f"{counts} counts per revolution")
        panels[1][column].set_xlabel("speed [m/s]")
    panels[0][0].set_ylabel("error of the mean [%]")
    panels[1][0].set_ylabel("noise, standard deviation [%]")
    panels[0][0].legend(fontsize="small")
    figure.savefig(file, dpi=110)


def worst(rows: Rows, prefix: str = "") -> float:
    """The greatest error of the mean."""
    return max(abs(row[f"{prefix}mean_error"]) for row in rows)


def summary(rate_hz: int, rows: Rows) -> list[list[str]]:
    """One row per encoder and estimator: greatest error of the mean, noise over all speeds."""
    found = []
    for counts in (360, 1440):
        chosen = [row for row in rows if row["counts_per_revolution"] == counts]
        for prefix, label in (("obvious_", "tick to tick"), ("", "Wheelwire")):
            noise = math.sqrt(sum(row[f"{prefix}noise"] ** 2 for row in chosen) / len(chosen))
            error = worst(chosen, prefix)
            found.append([f"{rate_hz} Hz", str(counts), label, f"{error:.2%}", f"{noise:.2%}"])
    return found


def main() -> int:
    """Print the table and plot it; returns 1 if the target is missed."""
    folder = output_folder(__doc__)
    rows = {rate_hz: run(rate_hz) for rate_hz in TARGETS}
    plot(rows[DEFAULT_HZ], folder / "velocity.png")
    header = (
        "control rate",
        "counts",
        "estimator",
        "worst error of the mean",
        "noise, rms over the speeds",
    )
    lines = [line for rate_hz in TARGETS for line in summary(rate_hz, rows[rate_hz])]
    sys.stdout.write(table(header, lines))
    return int(any(worst(rows[rate_hz]) > target for rate_hz, target in TARGETS.items()))


if __name__ == "__main__":
    sys.exit(main())
