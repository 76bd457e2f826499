"""How long a robot is driven on when its application, or the process that moves its pins, dies.

Usage: python bench/dying.py [RUNS [BUSY [PLACE...]]]: RUNS of each, beside BUSY processes
that keep the cores busy.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from rich.console import Console
from rich.table import Table

from support.driver_bench.rig import busy
from support.dying import CORE_WAYS, WAYS, Death, die

PLACES = ("serial", "pigpio", "l298n", "l298n, software PWM", "mock")
CORE_PLACES = ("pigpio", "l298n", "l298n, software PWM")
PHASE_S = 0.0037
"""The failure falls anywhere in a control period and between two setpoints."""


def main() -> None:
    """See the module."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    processes = int(sys.argv[2]) if len(sys.argv) > 2 else 4
    places = sys.argv[3:] or PLACES
    table = Table(title=f"{runs} runs each, {processes} busy processes; median / longest, ms")
    for column in ("driver", "what died", "to drive removed", "after the deadline", "to its end"):
        table.add_column(column, justify="left" if column in ("driver", "what died") else "right")
    with busy(processes):
        for place in places:
            ways = [*WAYS, *(CORE_WAYS if place in CORE_PLACES else ())]
            for way in ways:
                deaths = [die(place, way, run * PHASE_S) for run in range(runs)]
                table.add_row(place, way, *_cells(deaths, way))
                Console(stderr=True).print(place, way, *_cells(deaths, way), sep=" | ")
    Console(width=140).print(table)


def _cells(deaths: list[Death], way: str) -> tuple[str, str, str]:
    late = [d.late_us for d in deaths]
    ended = [d.ended_us for d in deaths if d.ended_us is not None]
    return (
        _cell([d.failure_to_removed_us for d in deaths]),
        "" if way in CORE_WAYS or max(late) < 0 else _cell(late),
        _cell(ended) if ended else "",
    )


def _cell(values_us: list[int]) -> str:
    ordered = sorted(values_us)
    return f"{ordered[len(ordered) // 2] / 1000:.1f} / {ordered[-1] / 1000:.1f}"


if __name__ == "__main__":
    main()
