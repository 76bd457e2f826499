"""A robot's parameters as a YAML file: written from one robot, compared with or set on another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wheelwire_protocol.parameters import PARAMETER_BY_NAME, Parameter

from ...arguments import at_home
from ...errors import ConfigurationError, ParameterOutOfRange
from ...link.info import DeviceInfo
from ...parameters import ParameterInfo, checked_value, number_text
from .reading import Section, reading

_IDENTITY = ("board", "board_id", "firmware")


@dataclass(frozen=True)
class ParameterFile:
    """The content of a file: values by name, in their parameters' units, and their robot.

    Attributes:
        values: Values in the file's order; not necessarily of all parameters.
        board: Kind of the board that the values are from, such as `ESP32`; empty if unknown.
        board_id: Id of that board; empty if unknown.
        firmware: Release of its firmware; empty if unknown.
    """

    values: dict[str, float]
    board: str = ""
    board_id: str = ""
    firmware: str = ""

    @property
    def source(self) -> str:
        """The board, for messages."""
        return f"{self.board} {self.board_id}".strip() or "an unknown board"

    @classmethod
    def of_robot(
        cls, parameters: Iterable[ParameterInfo], device: DeviceInfo | None
    ) -> ParameterFile:
        """The parameters that a robot has now. `device` is None if its driver does not know it."""
        return cls.of_values({p.name: p.value for p in parameters}, device)

    @classmethod
    def of_values(cls, values: dict[str, float], device: DeviceInfo | None) -> ParameterFile:
        """As `of_robot`, of these values."""
        if device is None:
            return cls(values)
        return cls(values, device.board.name, device.board_id, device.release.release)

    def as_mapping(self) -> dict[str, Any]:
        """The content of the file, as YAML and JSON have it."""
        identity = {key: getattr(self, key) for key in _IDENTITY if getattr(self, key)}
        values = {name: _with_unit(PARAMETER_BY_NAME[name], v) for name, v in self.values.items()}
        return {**identity, "parameters": values}

    def text(self) -> str:
        """The file: one line for each value."""
        content = self.as_mapping()
        lines = ["# Parameters of a robot, for `wheelwire params import` and `params diff`."]
        # The id is in quotes: without them, YAML reads many ids as numbers.
        lines += [f'{key}: "{content[key]}"' for key in _IDENTITY if key in content]
        lines += ["parameters:"]
        lines += [f"  {name}: {value}" for name, value in content["parameters"].items()]
        return "\n".join(lines) + "\n"


def load_parameter_file(file: str | Path) -> ParameterFile:
    """Read and check a file.

    Raises:
        InvalidArgument: The file is a device.
        ConfigurationError: The message has the file, the key, the value and what is allowed.
    """
    with reading(at_home(Path(file)), "parameters") as content:
        given = Section({} if content is None else content, [*_IDENTITY, "parameters"], "", _PLACES)
        values = parameter_values(given.get("parameters", None))
        if not values:
            raise ConfigurationError(
                "the file has no parameters: give them below `parameters:`; "
                "`wheelwire params export` writes such a file"
            )
        # YAML reads an unquoted id of digits alone as a number.
        return ParameterFile(values, *(str(given.get(key, None) or "") for key in _IDENTITY))


def parameter_values(content: object) -> dict[str, float]:
    """The values of a section `parameters`; each is a number, or a number and its unit: `0.033 m`.

    Raises:
        ConfigurationError: A name is unknown, or a value is out of range or not a number.
    """
    section = Section({} if content is None else content, PARAMETER_BY_NAME, "parameters")
    return {name: parameter_value(section, name) for name in section.values}


def parameter_value(section: Section, name: str) -> float:
    """The value of one parameter, checked."""
    value = _without_unit(section, PARAMETER_BY_NAME[name])
    # A bool is an int, too: `true` and `false` are how people write a switch.
    if not isinstance(value, (int, float)):
        raise section.refusal(name, "it must be a number")
    try:
        return checked_value(name, value)
    except ParameterOutOfRange as error:
        raise section.refusal(name, f"it must be {error.bound}") from error


_PLACES = {"parameters": PARAMETER_BY_NAME}


def _without_unit(section: Section, definition: Parameter) -> object:
    """The number of `0.033 m`; returns any other text as it is, for the caller to refuse."""
    value = section.get(definition.name)
    if not isinstance(value, str):
        return value
    number, _, unit = value.strip().partition(" ")
    try:
        result = float(number)
    except ValueError:
        return value
    own = _unit(definition)
    if unit.strip() not in ("", own):
        rule = f"give it in {own}" if own else "it has no unit; give the number alone"
        raise section.refusal(definition.name, rule)
    return result


def _with_unit(definition: Parameter, value: float) -> str | float:
    unit = _unit(definition)
    if unit:
        return f"{number_text(value)} {unit}"
    return int(value) if value == int(value) else value


def _unit(definition: Parameter) -> str:
    """The unit in one word: `duty`, not `duty (-1..1)`."""
    return definition.unit.value.partition(" ")[0]
