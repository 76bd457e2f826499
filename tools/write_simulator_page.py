"""Write the lists of docs/simulator.md: the simulator's variables and the built-in plants.

tools/write_simulator_page.py            writes them; needs `make sim`
tools/write_simulator_page.py --check    fails when they are not what simulator and plants say
"""

from __future__ import annotations

import re
import sys

import generated
from wheelwire.simulation.libfwsim import FwSim, Variable
from wheelwire.tools.files.plant import load_plant, shipped_plants

PAGE = generated.ROOT / "docs" / "simulator.md"
SWITCH = "0 or 1"
"""The unit of a variable that is on or off."""


def number(value: float) -> str:
    """Six digits at the most."""
    return f"{value:.6g}"


def has_left_counterpart(variable: Variable, names: set[str]) -> bool:
    """Whether the page shows it by its left counterpart."""
    left = re.sub(r"^(true\.)?right([._])", r"\1left\2", variable.name)
    return left != variable.name and left in names


def variables() -> str:
    """The simulator's variables, one of each pair."""
    simulator = FwSim()
    every = simulator.variables()
    names = {variable.name for variable in every}
    shown = [variable for variable in every if not has_left_counterpart(variable, names)]
    settable = [v for v in shown if v.settable]
    values = [
        [
            f"`{v.name}`",
            f"{number(v.minimum)}..{number(v.maximum)} {v.unit}".rstrip()
            + (f" ({number(default)})" if (default := simulator.get(v.name)) else ""),
            v.doc,
        ]
        for v in settable
        if v.unit != SWITCH
    ]
    switches = [
        [f"`{v.name}`", ("By default 1. " if simulator.get(v.name) else "") + v.doc]
        for v in settable
        if v.unit == SWITCH
    ]
    readings = [
        [f"`{v.name}`" + (f", {v.unit}" if v.unit not in {"", SWITCH} else ""), v.doc]
        for v in shown
        if not v.settable
    ]
    return (
        "Each with its range and, unless it is 0, its default:\n\n"
        + listed(together(values))
        + "\n0 or 1, by default 0:\n\n"
        + listed(together(switches))
        + "\nRead-only:\n\n"
        + listed(together(readings))
    )


def listed(rows: list[list[str]]) -> str:
    """A list; the last cell of each row is the meaning of the others."""
    return "".join(f"- {', '.join(row[:-1])}: {row[-1]}\n" for row in rows)


def together(rows: list[list[str]]) -> list[list[str]]:
    """One row for variables that differ only in their name."""
    names: dict[tuple[str, ...], list[str]] = {}
    for name, *rest in rows:
        names.setdefault(tuple(rest), []).append(name)
    return [[", ".join(alike), *rest] for rest, alike in names.items()]


def plants() -> str:
    """The built-in plants."""
    return listed([[f"`{name}`", f"{load_plant(name).title}."] for name in shipped_plants()])


def main() -> str | None:
    """Write or check the page."""
    parts = {"plants": plants(), "variables": variables()}
    return generated.write({PAGE: generated.filled(PAGE, parts)})


if __name__ == "__main__":
    sys.exit(main())
