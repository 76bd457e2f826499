"""A plant as data: the variables of a simulated robot, in a YAML file.

title: My robot         # in a line
variables:              # names and units as in docs/simulator.md, set in this order
  mass_kg: 1.5
  motor.supply_v: {value: 12, source: "data sheet XY, page 2"}
  slope_rad: {value: 0.02, assumed: the workshop's floor}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ...arguments import is_number
from ...errors import ConfigurationError
from .reading import Section, file_named, names_in, reading

SHIPPED = Path(__file__).parents[2] / "simulation" / "plants"


@dataclass(frozen=True)
class Plant:
    """A robot to simulate.

    Attributes:
        title: The robot in a line.
        settings: Values by the variable's name, in the order in which they are set.
    """

    title: str
    settings: dict[str, float]


def shipped_plants() -> list[str]:
    """The names of the built-in plants."""
    return names_in(SHIPPED)


def load_plant(name: str | Path) -> Plant:
    """Read a plant from a file, or a built-in one by its name.

    Raises:
        ConfigurationError: The file does not exist or is invalid.
    """
    with reading(file_named(name, SHIPPED, "plant"), "plant") as content:
        return parse_plant(content)


def parse_plant(content: object) -> Plant:
    """Build a plant from the content of a file. The simulator checks names and bounds.

    Raises:
        ConfigurationError: The content is invalid.
    """
    file = Section(content, ["title", "variables"])
    given = file.get("variables", {})
    variables = Section(given, given, "variables")
    return Plant(
        str(file.get("title", "")),
        {name: _parse_value(name, value) for name, value in variables.values.items()},
    )


def _parse_value(name: str, given: object) -> float:
    key = f"variables.{name}"
    entry = given if isinstance(given, Mapping) else {"value": given}
    fields = Section(entry, ["value", "source", "assumed"], key)
    value = fields.get("value")
    if not is_number(value):
        raise fields.refusal("value", "it must be a number")
    if {"source", "assumed"} <= set(fields.values):
        raise ConfigurationError(f"{key}: source and assumed are both given: remove one of them")
    return float(value)
