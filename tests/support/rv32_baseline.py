"""The core's cost at the last release, and what has grown since.

`make rv32-baseline RELEASE=...` writes it.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))
from support import rv32

FILE = rv32.ROOT / "firmware" / "esp32" / "rv32" / "baseline.json"

GROWTH_LIMIT = 0.05
"""The growth of an instruction count that is too much for one release."""


class Baseline(NamedTuple):
    """The figures of a release, and its compiler."""

    release: str
    compiler: str
    figures: dict[str, int]


def load() -> Baseline:
    """The committed baseline."""
    return Baseline(**json.loads(FILE.read_text("utf-8")))


def figures(cost: rv32.Cost) -> dict[str, int]:
    """The figures that must not grow, by name."""
    found: dict[str, int] = {}
    for work, counts in cost.instructions.items():
        found |= {f"{work}, median": counts.median, f"{work}, max": counts.max}
    return found | {"code_bytes": cost.code_bytes, "ram_bytes": cost.ram_bytes}


def growth(now: dict[str, int], before: dict[str, int]) -> dict[str, float]:
    """By name the growth as a share, negative where less is needed.

    Raises:
        KeyError: A figure is missing in the baseline: write it again.
    """
    return {name: figure / before[name] - 1 for name, figure in now.items()}


def too_much(grown: dict[str, float]) -> dict[str, float]:
    """The counts of instructions that reach the limit. Sizes have an upper bound of their own."""
    return {
        name: share
        for name, share in grown.items()
        if share >= GROWTH_LIMIT and not name.endswith("_bytes")
    }


def write(release: str) -> None:
    """Measure, and write the baseline of a release."""
    rv32.build()
    baseline = Baseline(release, rv32.compiler_version(), figures(rv32.cost()))
    FILE.write_text(json.dumps(baseline._asdict(), indent=2) + "\n", "utf-8")


def release_number(text: str) -> str:
    """`text`, if it is a release's number; an error of the command line otherwise."""
    if not re.fullmatch(r"\d+\.\d+\.\d+", text):
        raise argparse.ArgumentTypeError(f"{text!r} is no release's number, such as 0.1.0")
    return text


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Write the core's cost as a release's baseline.")
    parser.add_argument("release", type=release_number, help="which one, such as 0.1.0")
    write(parser.parse_args(arguments).release)


if __name__ == "__main__":
    main()
