"""The display of the demonstration: a live table, or plain lines without a terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple, Protocol

from rich.console import Console
from rich.live import Live
from rich.table import Table

from wheelwire.link.info import LinkStatistics
from wheelwire.motion.odometry import Pose
from wheelwire.samples import WheelSample

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


class Display(Protocol):
    """Shows views; may skip one that follows another too soon."""

    def show(self, view: View) -> None:
        """Show `view`."""


@contextmanager
def open_display(console: Console) -> Iterator[Display]:
    """Open a live table on a terminal, else print plain lines."""
    if not console.is_terminal:
        yield _LineDisplay(console)
        return
    with Live(console=console, refresh_per_second=LIVE_REFRESH_HZ) as area:
        yield _TableDisplay(area)


class _LineDisplay:
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


class _TableDisplay:
    def __init__(self, area: Live) -> None:
        self._area = area

    def show(self, view: View) -> None:
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
            "link",
            f"{link.frames_received} frames, {link.frames_lost} lost, {link.bad} damaged",
        )
        table.add_row(
            "timing",
            f"round trip {link.round_trip_p50_us / 1000:.2f} ms, "
            f"clock within {link.clock_error_us / 1000:.2f} ms",
        )
        self._area.update(table)


def _bar(speed_mps: float, duty: float) -> str:
    """A bar with zero duty in its middle, and the numbers."""
    middle = BAR_WIDTH // 2
    filled = round(duty * middle)
    cells = ["·"] * BAR_WIDTH
    for index in range(min(0, filled), max(0, filled) + 1):
        cells[middle + index] = "█"
    return f"{speed_mps:+.3f} m/s   duty {duty:+.2f} {''.join(cells)}"
