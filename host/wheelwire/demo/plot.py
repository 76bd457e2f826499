"""The plot of a run: commanded, estimated and true path."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wheelwire.motion.odometry import Pose


def save_trajectory(
    file: Path, commanded: Sequence[Pose], odometry: Sequence[Pose], true: Sequence[Pose]
) -> None:
    """Write a PNG of the three paths, in metres.

    Raises:
        ImportError: matplotlib is not installed.
        OSError: The file cannot be written.
    """
    from matplotlib.figure import Figure  # not pyplot, which needs a display

    figure = Figure(figsize=(9, 5), layout="constrained")
    axes = figure.subplots()
    # From the widest to the narrowest, so that each line shows below the next one.
    styles: dict[str, dict[str, Any]] = {
        "commanded": {"color": "#bbbbbb", "linewidth": 5},
        "true (plant)": {"color": "#1b7837", "linewidth": 2},
        "odometry": {"color": "#762a83", "linewidth": 1.2, "linestyle": "--"},
    }
    for (label, style), poses in zip(styles.items(), (commanded, true, odometry), strict=True):
        axes.plot([p.x_m for p in poses], [p.y_m for p in poses], label=label, **style)
    axes.plot(true[-1].x_m, true[-1].y_m, "o", color="#1b7837", label="standstill")
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title="Figure eight, then a hang")
    axes.grid(alpha=0.3)
    axes.legend(loc="best")
    figure.savefig(file, dpi=120)
