"""Tick loss of each driver over wheel speed and computer load: `make bench`.

docs/drivers.md says what the stand-ins are, and what not to conclude.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import output_folder, table
from support.driver_bench import firmware_rig
from support.driver_bench.gpio_rig import GpioRig
from support.driver_bench.pigpio_rig import PigpioRig
from support.driver_bench.rig import Counting, Timing, busy

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RATES_TPS = (1_000, 3_000, 10_000, 30_000, 60_000, 100_000, 150_000, 250_000)
FIRMWARE_RATES_TPS = (1_000, 10_000, 100_000, round(firmware_rig.LARGEST_TPS))
LOADS = (0, 2, 4)
"""Busy processes beside the driver."""
BROKEN = 1e-3
"""Fraction of the ticks lost."""
SOURCE_KEEPS_UP = 0.85
"""Fraction of the requested rate; below it the stand-in is too slow to judge the driver."""

METHOD = """\
Behind pigpio and l298n are stand-ins that make edges at a given rate in a process of their own; the
drivers, their callbacks and threads are the real ones. The firmware is its core in virtual time.
"""
COUNTING = ("driver", "ticks/s a wheel", "true", "counted", "off by", "noticed", "CPU")
TIMING = ("driver", "stop: median", "stop: worst", "PWM update: asked", "PWM update: worst")


@dataclass
class Series:
    """One driver under one load."""

    name: str
    load: int | None
    countings: list[Counting] = field(default_factory=list)
    timing: Timing | None = None

    @property
    def label(self) -> str:
        """For the legend."""
        return self.name if self.load is None else f"{self.name}, {self.load} busy processes"


def measure() -> list[Series]:
    """All series, in one run."""
    # In virtual time, in which other processes make no difference: one series, without a load.
    firmware = Series("firmware", None)
    firmware.countings = [firmware_rig.count(rate) for rate in FIRMWARE_RATES_TPS]
    firmware.timing = firmware_rig.time_stops()
    series = [firmware]
    for rig_class in (PigpioRig, GpioRig):
        for load in LOADS:
            with busy(load), rig_class() as rig:
                one = Series(rig.name, load)
                one.timing = rig.time_stops()
                for rate in RATES_TPS:
                    counting = rig.count(rate)
                    if counting.true_tps < SOURCE_KEEPS_UP * rate:
                        # This says nothing about the driver, nor would a higher rate.
                        break
                    one.countings.append(counting)
                    if counting.lost > BROKEN:
                        # Kept, as the rate at which it breaks; higher ones are worse.
                        break
                series.append(one)
    return series


def counting_rows(series: list[Series]) -> list[list[str]]:
    """One row per driver, load and rate."""
    return [
        [
            *(one.label, f"{c.asked_tps:.0f}", str(c.true_ticks), str(c.counted_ticks)),
            *(f"{c.lost:.3%}", str(c.reported), f"{c.cpu:.0%}" if c.cpu else ""),
        ]
        for one in series
        for c in one.countings
    ]


def timing_rows(series: list[Series]) -> list[list[str]]:
    """One row per driver and load."""
    found = []
    for one in series:
        if one.timing:
            late = sorted(one.timing.stop_late_us)
            figures = (late[len(late) // 2], late[-1], one.timing.period_us)
            worst = one.timing.worst_step_us
            found.append([one.label, *(f"{us / 1000:.1f}" for us in (*figures, worst))])
    return found


def draw(series: list[Series], file: Path) -> None:
    """Losses over speed, and the lateness of stops."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    losses, stops = figure.subplots(1, 2)
    colours = {"firmware": "#1b7837", "pigpio": "#762a83", "l298n": "#e08214"}
    styles: dict[int | None, Any] = {None: "-", 0: "-", 2: "--", 4: ":"}
    for one in series:
        losses.plot(
            [c.asked_tps for c in one.countings],
            [100 * c.lost for c in one.countings],
            styles[one.load],
            color=colours[one.name],
            marker="o",
            label=one.label,
        )
    losses.set_xscale("log")
    # Most losses are 0, which a purely logarithmic axis cannot show.
    losses.set_yscale("symlog", linthresh=0.01)
    losses.set(xlabel="ticks per second, each wheel", ylabel="count off by [%]")
    losses.set_ylim(bottom=-0.002)
    losses.legend(fontsize=8)
    losses.grid(alpha=0.3)
    _draw_stops(stops, series)
    figure.savefig(file, dpi=110)


def _draw_stops(axes: Axes, series: list[Series]) -> None:
    timed = [one for one in series if one.timing]
    late_ms = [[us / 1000 for us in one.timing.stop_late_us] for one in timed if one.timing]
    # Whiskers to the extremes: of a stop the worst case counts.
    axes.boxplot(late_ms, orientation="horizontal", whis=(0, 100))
    axes.set_yticks(range(1, len(timed) + 1), [one.label for one in timed], fontsize=8)
    axes.set(xlabel="deadline to EN low [ms]")
    axes.grid(alpha=0.3)


def main() -> None:
    """Measure, print, draw."""
    folder = output_folder(__doc__)
    series = measure()
    draw(series, folder / "drivers.png")
    sys.stdout.write(f"## The drivers\n\n{METHOD}\n{table(COUNTING, counting_rows(series))}\n")
    sys.stdout.write("From the setpoint's deadline to EN low, and between PWM updates, in ms:\n\n")
    sys.stdout.write(f"{table(TIMING, timing_rows(series))}\n![Losses and stops](drivers.png)\n")


if __name__ == "__main__":
    main()
