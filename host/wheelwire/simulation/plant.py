"""A plant as data: the variables of a simulated robot, in a YAML file.

title: My robot         # in a line
variables:              # names and units as in docs/simulator.md, set in this order
  mass_kg: 1.5
  motor.supply_v: {value: 12, source: "data sheet XY, page 2"}
  slope_rad: {value: 0.02, assumed: the workshop's floor}
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from wheelwire.arguments import top_level
from wheelwire.errors import ConfigurationError, shown

SHIPPED = Path(__file__).parent / "plants"
_FIELDS = {"value", "source", "assumed"}


@dataclass(frozen=True)
class PlantValue:
    """The value of one variable.

    Attributes:
        value: In the variable's unit.
        source: Where it is from, or why it is assumed; empty in a file that does not say.
        assumed: No source says so.
    """

    value: float
    source: str = ""
    assumed: bool = False


@dataclass(frozen=True)
class Plant:
    """A robot to simulate.

    Attributes:
        title: What it is, in a line.
        values: By the variable's name, in the order in which they are set.
    """

    title: str
    values: Mapping[str, PlantValue]

    @property
    def settings(self) -> dict[str, float]:
        """The values alone, as `Simulator(settings=...)` takes them."""
        return {name: value.value for name, value in self.values.items()}


def shipped_plants() -> list[str]:
    """The names of the built-in plants."""
    return sorted(path.stem for path in SHIPPED.glob("*.yaml"))


def load_plant(name: str | Path) -> Plant:
    """Read a plant from a file, or a built-in one by its name.

    Raises:
        ConfigurationError: The file does not exist or is invalid.
    """
    # Here: a plant that is described in Python needs no PyYAML.
    from wheelwire.yaml_file import reading

    known = shipped_plants()
    path = SHIPPED / f"{name}.yaml" if str(name) in known else Path(name)
    if not path.exists():
        raise ConfigurationError(
            f"{name}: there is no such file, and the built-in plants are {', '.join(known)}"
        )
    with reading(path, "plant") as content:
        return parse_plant(content)


def parse_plant(content: object) -> Plant:
    """Build a plant from the content of a file. The simulator checks names and bounds.

    Raises:
        ConfigurationError: The content is invalid.
    """
    given = top_level(content)
    for name, value in given.items():
        if name not in ("title", "variables"):
            raise ConfigurationError(
                f"{name} = {shown(value)}: a plant has `title` and `variables`, nothing else"
            )
    variables = given.get("variables", {})
    if not isinstance(variables, dict):
        raise ConfigurationError(
            f"variables = {shown(variables)}: give names with values, as in `mass_kg: 1.5`"
        )
    return Plant(
        str(given.get("title", "")),
        {str(name): _parse_value(str(name), value) for name, value in variables.items()},
    )


def _parse_value(name: str, entry: object) -> PlantValue:
    fields = entry if isinstance(entry, dict) else {"value": entry}
    value = fields.get("value")
    # YAML makes a bool of `yes`, and a bool is an int.
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ConfigurationError(
            f"variables.{name} = {shown(entry)}: give a finite number, or one as its `value`"
        )
    if not set(fields) <= _FIELDS or {"source", "assumed"} <= set(fields):
        raise ConfigurationError(
            f"variables.{name} = {shown(entry)}: give `value` and either `source` or `assumed`"
        )
    source = str(fields.get("source", fields.get("assumed", "")))
    return PlantValue(float(value), source, "assumed" in fields)
