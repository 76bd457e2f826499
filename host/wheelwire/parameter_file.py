"""A robot's parameters as a YAML file: written from one robot, compared with or set on another."""

from __future__ import annotations

import struct
import time
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wheelwire_protocol.parameters import PARAMETER_BY_NAME, Changes, Parameter

from .arguments import top_level
from .config import check_names, checked_parameter, mapping
from .errors import (
    ConfigurationError,
    ImportFailed,
    InvalidArgument,
    LinkLost,
    RequestTimeout,
    WheelwireError,
)
from .link.info import DeviceInfo
from .parameters import (
    ParameterInfo,
    Parameters,
    check_value,
    decimal_of_float32,
    definition_of,
)
from .yaml_file import reading

RESTORE_TIMEOUT_S = 5.0
"""How long values are tried to be restored; the link may come back."""
_RETRY_PERIOD_S = 0.1
_IDENTITY = ("board", "board_id", "firmware")
_KEYS = [*_IDENTITY, "parameters"]


@dataclass(frozen=True)
class ParameterFile:
    """What a file holds: values by name, in their parameters' units, and whose they were.

    Attributes:
        values: In the file's order; not necessarily of all parameters.
        board: Kind of the board they were read from, such as `ESP32`; empty if unknown.
        board_id: Its id; empty if unknown.
        firmware: Its release; empty if unknown.
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
        """What a robot has now. `device` is None if its driver does not know it."""
        values = {p.name: p.value for p in parameters}
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
        # The id is quoted: many a one would be a number to YAML.
        lines += [f'{key}: "{content[key]}"' for key in _IDENTITY if key in content]
        lines += ["parameters:"]
        lines += [f"  {name}: {value}" for name, value in content["parameters"].items()]
        return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Difference:
    """One value that a robot and a file do not agree on."""

    name: str
    robot: float
    file: float
    unit: str


def load_parameter_file(file: str | Path) -> ParameterFile:
    """Read and check a file.

    A value is a number, or a number and its unit: `0.033 m`. A unit that is given must be the
    parameter's own.

    Raises:
        InvalidArgument: It is not a regular file.
        ConfigurationError: The message has the file, the key, the value and what is allowed.
    """
    source = Path(file)
    # Most likely the two arguments are swapped: reading a port here could block for ever.
    if source.is_char_device() or source.is_block_device() or source.is_socket():
        raise InvalidArgument(f"{source} is not a file: give ROBOT first, then FILE")
    # A robot's file gets a sentence of its own.
    with reading(source) as content:
        return _parse(content)


def differences(robot: Iterable[ParameterInfo], wanted: Mapping[str, float]) -> list[Difference]:
    """The values of `wanted` that the robot does not have, in the robot's order.

    Raises:
        UnknownParameter: The robot does not have a parameter of `wanted`.
    """
    infos = {p.name: p for p in robot}
    found = []
    for name in wanted:
        if name not in infos:  # its firmware would be of another release, which a hello refuses
            definition_of(name)
            raise WheelwireError(f"the robot has no parameter {name}: install one release on both")
    for name, info in infos.items():
        # Rounded as the device rounds it: a value with more digits would always differ.
        if name in wanted and (value := _as_held(wanted[name])) != info.value:
            found.append(Difference(name, info.value, value, info.unit))
    return found


def apply(
    parameters: Parameters, wanted: Mapping[str, float], *, save: bool = False
) -> list[Difference]:
    """Set all of `wanted`, or nothing: after a failure the former values are set again.

    Values that the robot already has are not set. Other parameters are left alone.

    Args:
        parameters: Of the robot.
        wanted: Values by name.
        save: Also save them all, including those that the robot already had. No other is saved.

    Returns:
        What was different before.

    Raises:
        UnknownParameter: Nothing was changed.
        ParameterOutOfRange: Beyond the bounds of this robot. Nothing was changed.
        ImportFailed: A value was refused, or the link failed. The message says whether the former
            values are in force again.
    """
    before = parameters.list()
    # Each difference also has the robot's own value, to which `_restore` sets it back.
    changes = differences(before, wanted)
    bounds = {p.name: (p.minimum, p.maximum) for p in before}
    # All are checked before the first is set: a wrong value then changes nothing.
    for name, value in wanted.items():
        check_value(definition_of(name), value, bounds[name])
    # The switch of the e-stop contact comes last: an open contact latches an e-stop, in which
    # the switch itself can no longer be changed back. It also cannot be on trial.
    last = [change for change in changes if _changes(change.name) is Changes.RELEASED]
    others = [change for change in changes if change not in last]
    touched: list[Difference] = []
    saved: list[str] = []
    doing = ""
    try:
        if others:
            # Judged together at its end, so that it does not matter which value comes first. If
            # this program ends meanwhile, the device has its former values again by itself.
            with parameters.trial() as trial:
                for change in others:
                    doing = _not_set(change)
                    parameters.set(change.name, change.file)
                doing = "the values were not set"
                touched += others  # first: an unanswered request may have been carried out
                trial.keep()
        for change in last:
            doing = _not_set(change)
            touched.append(change)
            parameters.set(change.name, change.file)
        doing = "the values were not verified"
        _verify(parameters, wanted)
        if save:
            doing = "the values were not saved"
            _save(parameters, wanted, saved)
    except WheelwireError as error:
        outcome = _outcome(_restore(parameters, touched), saved)
        raise ImportFailed(f"{doing}: {_sentence(error)} {outcome}") from error
    except BaseException:
        # Ctrl-C, for one: half of the values must not stay in force.
        _restore(parameters, touched)
        raise
    return changes


def _verify(parameters: Parameters, wanted: Mapping[str, float]) -> None:
    """A robot that was reset meanwhile has some of its saved values again."""
    lost = differences(parameters.list(), wanted)
    if lost:
        again = f"{lost[0].name} = {number_text(lost[0].robot)}"
        raise WheelwireError(f"the robot has {again} again; was it reset? Import once more.")


def _save(parameters: Parameters, names: Collection[str], saved: list[str]) -> None:
    """Save these; those that were, one by one, are appended to `saved`."""
    if set(names) == set(parameters):
        parameters.save()  # at once: all or nothing
        return
    for name in names:
        parameters.save(name)
        # After each one: if the next fails, the message has to say what is in the store.
        saved.append(name)


def _restore(parameters: Parameters, touched: Collection[Difference]) -> list[str]:
    """Set the former values again, the newest change first; returns those that could not be."""
    # One limit for all values: without a link each one would take the whole of its own.
    end = time.monotonic() + RESTORE_TIMEOUT_S
    left = list(reversed(list(touched)))
    while left:
        failed = [change for change in left if not _set_again(parameters, change, end)]
        # Some are taken only after others: together with these they would contradict each other.
        if len(failed) == len(left):
            break
        left = failed
    return [change.name for change in left]


def _set_again(parameters: Parameters, change: Difference, end: float) -> bool:
    """Whether a former value is in force again; tries until `end` while the link is lost."""
    while True:
        try:
            parameters.set(change.name, change.robot)
        except (LinkLost, RequestTimeout):
            # The link may come back, or the next attempt be answered. A refusal is final.
            if time.monotonic() >= end:
                return False
        except WheelwireError:
            return False
        else:
            return True
        time.sleep(_RETRY_PERIOD_S)


def _not_set(change: Difference) -> str:
    wish = f"{number_text(change.file)} {change.unit}".rstrip()
    return f"{change.name} = {wish} was not set"


def _outcome(failed: Collection[str], saved: Collection[str]) -> str:
    text = "The former values are in force again."
    if failed:
        text = (
            f"The former values could not be restored: {', '.join(failed)}. "
            "Reset the robot: it then has the values that it had saved."
        )
    if saved:
        text += f" Saved before that: {', '.join(saved)}."
    return text


def _sentence(error: WheelwireError) -> str:
    text = str(error)
    return text if text.endswith((".", "?", "!")) else f"{text}."


def number_text(value: float) -> str:
    """A value with all its digits, whole ones without a point."""
    return str(int(value) if value == int(value) else value)


def _parse(content: object) -> ParameterFile:
    given = top_level(content or {})
    if "driver" in given or "driver_type" in given:
        raise ConfigurationError(
            "this is a robot's own file (it has `driver:`), which is a ROBOT, and its parameters "
            "are set when it is opened: give ROBOT first, then FILE, a file from "
            "`wheelwire params export`"
        )
    check_names(given, _KEYS, "")
    values = mapping("parameters", given.get("parameters") or {})
    if not values:
        raise ConfigurationError(
            "it has no parameters: give them below `parameters:`; "
            "`wheelwire params export` writes such a file"
        )
    check_names(values, list(PARAMETER_BY_NAME), "parameters.")
    return ParameterFile(
        {
            name: checked_parameter(name, _without_unit(PARAMETER_BY_NAME[name], value))
            for name, value in values.items()
        },
        # YAML reads an unquoted id of digits alone as a number.
        *(str(given.get(key) or "") for key in _IDENTITY),
    )


def _without_unit(definition: Parameter, value: object) -> object:
    """The number of `0.033 m`; anything that is not of this form is left to be refused."""
    if not isinstance(value, str):
        return value
    number, _, unit = value.strip().partition(" ")
    try:
        result = float(number)
    except ValueError:
        return value
    if unit.strip() not in ("", _unit(definition)):
        own = _unit(definition)
        raise ConfigurationError(
            f"parameters.{definition.name} = {value!r}: "
            + (f"give it in {own}" if own else "it has no unit; give the number alone")
        )
    return result


def _with_unit(definition: Parameter, value: float) -> str | float:
    unit = _unit(definition)
    if unit:
        return f"{number_text(value)} {unit}"
    return int(value) if value == int(value) else value


def _unit(definition: Parameter) -> str:
    """The unit in one word: `duty`, not `duty (-1..1)`."""
    return definition.unit.value.partition(" ")[0]


def _as_held(value: float) -> float:
    """The value as a device holds it, a 32-bit float, and reports it."""
    try:
        held = struct.pack("<f", value)
    except OverflowError:
        return value  # beyond what a device can hold, so it differs from whatever that has
    return decimal_of_float32(struct.unpack("<f", held)[0])


def _changes(name: str) -> Changes:
    return PARAMETER_BY_NAME[name].changes
