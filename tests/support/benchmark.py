"""Shared by the benchmarks: Markdown, interleaved rounds, the times of imports."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import NamedTuple

from wheelwire.link.statistics import quantile

ROOT = Path(__file__).parents[2]


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; the first column is aligned left, the others right."""
    rule = "|-|" + "-:|" * (len(header) - 1)
    return "\n".join([_row(header), rule, *map(_row, rows), ""])


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def spread(values: Sequence[float]) -> tuple[float, float, float]:
    """The median, the 99th percentile and the greatest."""
    return quantile(values, 0.5), quantile(values, 0.99), max(values)


class Target(NamedTuple):
    """A target in words, and whether it was reached."""

    what: str
    measured: str
    limit: str
    reached: bool


def summary_of_targets(targets: Sequence[Target]) -> str:
    """A sentence with the missed targets, and one with the others."""
    heads = {False: "**Missed**", True: "Reached"}
    parts = []
    for is_reached, head in heads.items():
        found = [f"{t.what} {t.measured} ({t.limit})" for t in targets if t.reached == is_reached]
        if found:
            parts.append(f"{head}, with the target: {'; '.join(found)}.\n")
    return "\n".join(parts)


def seconds(work: Callable[[], object], clock: Callable[[], float] = perf_counter) -> float:
    """The time of one call, by `clock`."""
    gc.collect()
    begin = clock()
    work()
    return clock() - begin


def cpu_seconds(work: Callable[[], object]) -> float:
    """The CPU time of one call, without the time that other processes had the processor."""
    return seconds(work, process_time)


def interleaved(measures: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, list[float]]:
    """Interleave the measurements: a disturbance then affects all of them in the same round.

    Returns:
        The value of each round, by name. An additional first round warms up and is left out.
    """
    values: dict[str, list[float]] = {name: [] for name in measures}
    for _ in range(1 + rounds):
        for name, measure in measures.items():
            values[name].append(measure())
    return {name: of_rounds[1:] for name, of_rounds in values.items()}


def ratio(numerators: Sequence[float], denominators: Sequence[float]) -> float:
    """The median of the ratios within a round."""
    return median(a / b for a, b in zip(numerators, denominators, strict=True))


def import_ms(modules: Iterable[str], rounds: int) -> dict[str, float]:
    """Milliseconds of each module's import in a fresh interpreter.

    The start of an empty interpreter is subtracted; it is listed under the name "".
    """
    statements = {"": "pass"} | {module: f"import {module}" for module in modules}
    starts = {name: partial(_start_ms, statement) for name, statement in statements.items()}
    times = interleaved(starts, rounds)
    idle = times.pop("")
    medians = {
        module: median(a - b for a, b in zip(of_module, idle, strict=True))
        for module, of_module in times.items()
    }
    return {"": median(idle)} | medians


def _start_ms(statement: str) -> float:
    command = [sys.executable, "-c", statement]
    # With the bytecode that an installed package has, which this variable would keep from disk.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    run = partial(subprocess.run, command, check=True, capture_output=True, env=environment)
    return 1e3 * seconds(run)
