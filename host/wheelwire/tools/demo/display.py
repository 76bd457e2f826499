"""What a run looks like: a live table, or plain lines without a terminal; at its end a plot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from rich.console import Console
from rich.live import Live
from rich.table import Table

from wheelwire.link.statistics import LinkStatistics
from wheelwire.motion.odometry import Pose
from wheelwire.samples import WheelSample
from wheelwire.whole_file import save_figure

PLAIN_PERIOD_S = 1.0
LIVE_REFRESH_HZ = 10
BAR_WIDTH = 21


class View(NamedTuple):
    """The state of the demonstration at one moment."""

    phase: str
    seconds: float
    pose: Pose
    sample: WheelSample
    statistics: LinkStatistics


Show: TypeAlias = Callable[[View], None]
"""Shows a view; may skip one that follows another too soon."""


@contextmanager
def open_display(console: Console) -> Iterator[Show]:
    """Open a live table on a terminal, else print plain lines."""
    if not console.is_terminal:
        yield _Lines(console).show
        return
    with Live(console=console, refresh_per_second=LIVE_REFRESH_HZ) as area:
        yield lambda view: area.update(_table(view))


class _Lines:
    def __init__(self, console: Console) -> None:
        self._console = console
        self._next_s = 0.0

    def show(self, view: View) -> None:
        if view.seconds < self._next_s:
            return
        self._next_s = view.seconds + PLAIN_PERIOD_S
        sample, pose = view.sample, view.pose
        self._console.print(
            f"{view.seconds:5.1f} s  {view.phase:12} {sample.state.name:9} "
            f"x {pose.x_m:+.3f} m  y {pose.y_m:+.3f} m  "
            f"heading {math.degrees(pose.heading_rad):+7.1f} deg  "
            f"left {sample.left_mps:+.3f} m/s  right {sample.right_mps:+.3f} m/s  "
            f"lost {view.statistics.frames_lost}",
            soft_wrap=True,
        )


def _table(view: View) -> Table:
    sample, pose, link = view.sample, view.pose, view.statistics
    title = f"{view.phase}  {view.seconds:4.1f} s"
    table = Table(title=title, title_justify="left", show_header=False)
    table.add_column("", style="cyan", no_wrap=True)
    table.add_column("", width=58, no_wrap=True)
    table.add_row("state", sample.state.name)
    table.add_row(
        "pose",
        f"x {pose.x_m:+.3f} m   y {pose.y_m:+.3f} m   "
        f"heading {math.degrees(pose.heading_rad):+.1f} deg",
    )
    table.add_row("left wheel", _bar(sample.left_mps, sample.left_duty))
    table.add_row("right wheel", _bar(sample.right_mps, sample.right_duty))
    table.add_row(
        "link", f"{link.frames_received} frames, {link.frames_lost} lost, {link.bad} damaged"
    )
    table.add_row(
        "timing",
        f"round trip {link.round_trip_p50_us / 1000:.2f} ms, "
        f"clock within {link.clock_error_us / 1000:.2f} ms",
    )
    return table


def _bar(speed_mps: float, duty: float) -> str:
    """A bar with zero duty in its middle, and the numbers."""
    middle = BAR_WIDTH // 2
    filled = round(duty * middle)
    cells = ["·"] * BAR_WIDTH
    for index in range(min(0, filled), max(0, filled) + 1):
        cells[middle + index] = "█"
    return f"{speed_mps:+.3f} m/s   duty {duty:+.2f} {''.join(cells)}"


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
    # Widest first, so that each line still shows below the next one.
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
    save_figure(figure, file, dpi=120)
