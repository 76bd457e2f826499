"""Error and noise of the measured velocity.

Over all speeds; also a picture at {DEFAULT_HZ} Hz. Needs `make cpp-tests`.
"""

from __future__ import annotations

import csv
import math
import subprocess

from matplotlib.figure import Figure

from harness import ROOT, Report, run

PROGRAM = ROOT / "build" / "host" / "wheelwire-velocity-curve"
DEFAULT_HZ = 1000
"""The control rate for the plot."""
TARGETS = {100: 0.003, 200: 0.003, 500: 0.002, DEFAULT_HZ: 0.002}
"""Target for the mean's error, by control rate. [Hz]"""
ESTIMATORS = {"obvious_": "tick to tick", "": "Wheelwire"}
COUNTS = (360, 1440)


def curves(rate_hz: int) -> list[dict[str, float]]:
    """The program's rows at a control rate; up to half a minute."""
    command = [str(PROGRAM), str(rate_hz)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(lines)]


def main(report: Report) -> None:
    """Print the table, and plot the mean's error above, the noise below."""
    figure, rows = Figure(figsize=(9, 5.5), layout="constrained"), []
    panels = figure.subplots(2, 2, sharex=True, sharey="row")
    for rate_hz, target in TARGETS.items():
        every = curves(rate_hz)
        for column, counts in enumerate(COUNTS):
            found = [row for row in every if row["counts_per_revolution"] == counts]
            for prefix, label in ESTIMATORS.items():
                error = max(abs(row[f"{prefix}mean_error"]) for row in found)
                noise = math.sqrt(sum(row[f"{prefix}noise"] ** 2 for row in found) / len(found))
                rows.append(f"{rate_hz} Hz | {counts} | {label} | {error:.2%} | {noise:.2%}")
                if rate_hz == DEFAULT_HZ:
                    for axes, what in zip(panels[:, column], ("mean_error", "noise"), strict=True):
                        speeds = [row["mps"] for row in found]
                        percent = [row[f"{prefix}{what}"] * 100 for row in found]
                        axes.plot(speeds, percent, label=label, linewidth=0.9)
                        axes.grid(alpha=0.3)
            what = f"error of the mean at {rate_hz} Hz, {counts} counts"
            report.at_most(what, 100 * error, 100 * target, " %")  # Wheelwire's is the last
            panels[0][column].set_title(f"{counts} counts per revolution")
            panels[1][column].set_xlabel("speed [m/s]")
    panels[0][0].set_ylabel("error of the mean [%]")
    panels[1][0].set_ylabel("noise, standard deviation [%]")
    panels[0][0].legend(fontsize="small")
    figure.savefig(report.folder / "velocity.png", dpi=110)
    report.table(
        "control rate | counts | estimator | worst error of the mean | noise, rms over the speeds",
        rows,
    )


run(main)
