"""Write the tables of docs/simulator.md: the simulator's variables and the built-in plants.

tools/write_simulator_page.py            writes them; needs `make sim`
tools/write_simulator_page.py --check    fails when they are not what simulator and plants say
"""

from __future__ import annotations

import re
import sys

import generated
from generated import table
from wheelwire.simulation.libfwsim import FwSim, Variable
from wheelwire.tools.files.plant import load_plant, shipped_plants

PAGE = generated.ROOT / "docs" / "simulator.md"


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
    settable = [
        [
            f"`{v.name}`",
            v.unit,
            f"{number(v.minimum)} to {number(v.maximum)}",
            number(simulator.get(v.name)),
            v.doc,
        ]
        for v in shown
        if v.settable
    ]
    readings = [[f"`{v.name}`", v.unit, v.doc] for v in shown if not v.settable]
    return (
        table(["variable", "unit", "range", "default", "meaning"], settable)
        + "\nRead-only:\n\n"
        + table(["variable", "unit", "meaning"], readings)
    )


def plants() -> str:
    """The built-in plants, with the source of each value."""
    units = {variable.name: variable.unit for variable in FwSim().variables()}
    text = []
    for name in shipped_plants():
        plant = load_plant(name)
        rows = [
            [
                f"`{variable}`",
                f"{number(value.value)} {units[variable].replace('0 or 1', '')}".strip(),
                ("assumed: " if value.assumed else "") + value.source,
            ]
            for variable, value in plant.values.items()
        ]
        text.append(
            f"### {name}\n\n{plant.title}.\n\n" + table(["variable", "value", "source"], rows)
        )
    return "\n".join(text)


def main() -> str | None:
    """Write or check the page."""
    parts = {"plants": plants(), "variables": variables()}
    return generated.write({PAGE: generated.filled(PAGE, parts)})


if __name__ == "__main__":
    sys.exit(main())
