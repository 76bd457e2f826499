"""CPU of links over robots per host and state rate: `make bench`, or this file."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import output_folder, table
from support.load import Load, frames_lost, load_while, read_for
from support.processes import cpu_s
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.port_policy import REST_US
from wheelwire.simulation.simulator import Simulator

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINKS = (1, 2, 4, 8, 16)
LINK_HZ = 100
RATES_HZ = (10, 100, 500, 1000, 2000, 5000)
READS_HZ = 50
SETTLING_S = 0.3
MEASURED_S = 2.0

METHOD = f"""\
All links in one process, a thread each; the firmware's core in a process of its own for each
robot, on the same {os.cpu_count()} cores; {MEASURED_S:g} s each. CPU is the host's process by the
kernel's accounts, of one core. *Round trip* is the median of the pings since the links were
opened; of several links the median link's and the worst one's.
"""
GROWTH = f"""\
Each further link costs about the same, the first one more. A link costs what its wake-ups cost,
and little more. While somebody asks there is one for each frame, and the cost is linear in the
rate; a fast stream that nobody asks for is read every {REST_US / 1e3:g} ms, and with its rate only
the decoding grows.
"""


@dataclass
class Point:
    """The load of some links, and whether they worked."""

    links: int
    rate_hz: int
    load: Load
    simulators_cpu: float
    """CPU of all simulated devices, as a fraction of one core."""
    received: int
    lost: int
    round_trips_us: Sequence[float]

    @property
    def frame_us(self) -> float:
        """CPU per state frame."""
        return 1e6 * self.load.cpu / (self.links * self.rate_hz)


def measure(links: int, rate_hz: int, reads_hz: int = 0) -> Point:
    """Open the links, let them run, close them; samples of the first may be read."""
    with ExitStack() as stack:
        simulators = [stack.enter_context(Simulator()) for _ in range(links)]
        robots = [_opened(stack, simulator, rate_hz) for simulator in simulators]
        # What opening the links costs is no part of their load.
        time.sleep(SETTLING_S)
        before = [robot.statistics for robot in robots]
        used = cpu_s([simulator.pid for simulator in simulators])
        load = load_while(lambda: read_for(MEASURED_S, robots[0], reads_hz))
        after = [robot.statistics for robot in robots]
        used = cpu_s([simulator.pid for simulator in simulators]) - used
    return Point(
        links,
        rate_hz,
        load,
        used / MEASURED_S,
        sum(s.frames_received for s in after) - sum(s.frames_received for s in before),
        sum(map(frames_lost, before, after)),
        [s.round_trip_p50_us for s in after],
    )


def _opened(stack: ExitStack, simulator: Simulator, rate_hz: int) -> SerialDriver:
    """Open a link at a rate for which the control rate may have to be raised."""
    if rate_hz > 1000:
        # Above the default control rate. The value outlasts this link, until the device's reset.
        with SerialDriver(simulator.port) as robot:
            robot.parameters.set("control_rate_hz", rate_hz)
    return stack.enter_context(SerialDriver(simulator.port, stream_rate_hz=rate_hz))


def show_links(points: Sequence[Point]) -> str:
    """The table over links."""
    header = (
        *("links", "CPU", "a link", "wake-ups/s", "frames", "lost"),
        *("round trip [us]", "worst", "CPU of the simulators"),
    )
    rows = [
        [
            str(p.links),
            *(f"{p.load.cpu:.1%}", f"{p.load.cpu / p.links:.2%}", f"{p.load.wake_ups:.0f}"),
            *(str(p.received), str(p.lost)),
            *(f"{us:.0f}" for us in (median(p.round_trips_us), max(p.round_trips_us))),
            f"{p.simulators_cpu:.0%}",
        ]
        for p in points
    ]
    return f"{LINK_HZ} states a second on each link:\n\n{table(header, rows)}"


def show_rates(points: Sequence[Point], title: str) -> str:
    """The table over rates."""
    header = ("states/s", "CPU", "a frame [us]", "wake-ups/s", "frames", "lost", "round trip [us]")
    rows = [
        [
            str(p.rate_hz),
            *(f"{p.load.cpu:.1%}", f"{p.frame_us:.0f}", f"{p.load.wake_ups:.0f}"),
            *(str(p.received), str(p.lost), f"{p.round_trips_us[0]:.0f}"),
        ]
        for p in points
    ]
    return f"{title}\n\n{table(header, rows)}"


def draw(
    links: Sequence[Point], unread: Sequence[Point], read: Sequence[Point], file: Path
) -> None:
    """Plot CPU over both."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    _draw(left, [p.links for p in links], links, "measured", "#1b7837")
    # From nothing to the last point: what lies above this line is the cost of the first links.
    end_percent = 100 * links[-1].load.cpu
    left.plot([0, LINKS[-1]], [0, end_percent], "--", color="#878787", label="linear")
    left.set(xlabel=f"links at {LINK_HZ} states/s", ylabel="CPU [% of a core]")
    _draw(right, RATES_HZ, unread, "nobody asks", "#1b7837")
    _draw(right, RATES_HZ, read, f"{READS_HZ} reads/s", "#762a83")
    right.set_xlabel("states/s on one link")
    for axes in (left, right):
        axes.legend()
        axes.grid(alpha=0.3)
    figure.savefig(file, dpi=80)


def _draw(axes: Axes, x: Sequence[int], points: Sequence[Point], name: str, colour: str) -> None:
    axes.plot(x, [100 * p.load.cpu for p in points], "o-", color=colour, label=name)


def main() -> int:
    """Measure, print, draw; returns 1 if frames were lost."""
    folder = output_folder(__doc__)
    links = [measure(count, LINK_HZ) for count in LINKS]
    unread, read = [], []
    # In turns, so that a slow moment of the computer affects both.
    for rate_hz in RATES_HZ:
        unread.append(measure(1, rate_hz))
        read.append(measure(1, rate_hz, READS_HZ))
    draw(links, unread, read, folder / "links_per_host.png")
    sys.stdout.write(f"## Links per host\n\n{METHOD}\n{show_links(links)}\n")
    sys.stdout.write(f"{show_rates(unread, 'One link, nobody asks for samples:')}\n")
    sys.stdout.write(f"{show_rates(read, f'One link, {READS_HZ} reads a second:')}\n")
    sys.stdout.write(f"{GROWTH}\n![CPU over links and rates](links_per_host.png)\n")
    return int(any(point.lost for point in (*links, *unread, *read)))


if __name__ == "__main__":
    sys.exit(main())
