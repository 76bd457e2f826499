"""Checks of arguments: setpoints, numbers within bounds, names, paths; of any type given."""

from __future__ import annotations

import math
import os
from enum import Enum
from numbers import Real
from pathlib import Path
from typing import Any

from .errors import InvalidArgument, InvalidCommand, shown, with_point

LONGEST_WAIT_S = 3600.0
"""Longest time-out of any call, and longest time to live: every device shortens that further."""


def is_number(value: object) -> bool:
    """Whether it is a finite real number of a Python or NumPy type. A bool is not."""
    # Nearly all are plain floats: avoid the slow check against an abstract class.
    if type(value) is not float and (isinstance(value, bool) or not isinstance(value, Real)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an int that no float can hold
        return False


def number(
    name: str, value: object, low: float, high: float, error: type[InvalidArgument]
) -> float:
    """Return `value` as a float if it is a finite number from `low` to `high`.

    Raises:
        InvalidArgument: It is not, raised as `error`.
    """
    if is_number(value):
        checked = float(value)  # type: ignore[arg-type]
        if low <= checked <= high:
            return checked
    raise error(
        f"{name} = {shown(value)}: give a number from {low:g} to {high:g}{with_point(value)}"
    )


def finite(name: str, value: float) -> float:
    """Return a part of a setpoint as a float.

    Raises:
        InvalidCommand: It is not a finite number.
    """
    if type(value) is float and math.isfinite(value):  # what nearly every setpoint is made of
        return value
    if not is_number(value):
        raise InvalidCommand(f"{name} = {shown(value)}: give a finite number")
    return float(value)


def ttl_s(ttl: float) -> float:
    """Return a setpoint's time to live, of at most `LONGEST_WAIT_S`.

    Raises:
        InvalidCommand: It is not a number above 0.
    """
    if not (is_number(ttl) and ttl > 0):
        raise InvalidCommand(f"ttl = {shown(ttl)}: give the setpoint a time to live above 0 s")
    # Shortened and not refused: where its limit is not known the device shortens it in any case.
    return min(float(ttl), LONGEST_WAIT_S)


def whole(name: str, value: object, low: int, high: int) -> int:
    """Return `value` as an int if it is a whole number from `low` to `high`.

    Raises:
        InvalidArgument: It is not.
    """
    # 115200.0 is a whole number, too, and so is one of NumPy's.
    if is_number(value):
        checked = int(value)  # type: ignore[call-overload]
        if checked == value and low <= checked <= high:
            return int(checked)
    raise InvalidArgument(f"{name} = {shown(value)}: give a whole number from {low} to {high}")


def timeout_s(name: str, value: object) -> float:
    """Return `value` as a time-out in seconds.

    Raises:
        InvalidArgument: It is not a valid one: no call may wait forever.
    """
    return number(name, value, 0.0, LONGEST_WAIT_S, InvalidArgument)


def text(name: str, value: object, example: str) -> str:
    """Return `value` as a string that is not empty; a path is converted.

    Raises:
        InvalidArgument: It is neither.
    """
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, str) and value:
        return value
    raise InvalidArgument(f"{name} = {shown(value)}: give a name, such as {example}")


def path(name: str, value: object) -> Path:
    """Return `value` as a path.

    Raises:
        InvalidArgument: It is not a path.
    """
    if isinstance(value, (str, os.PathLike)):
        found = os.fspath(value)
        if "\0" in found:
            raise InvalidArgument(f"{name} = {shown(value)}: no file can have this name")
        return at_home(Path(found))
    raise InvalidArgument(f"{name} = {shown(value)}: give a path")


def at_home(path: Path) -> Path:
    """`path`, where a leading `~` means the home folder, as in a shell.

    Raises:
        InvalidArgument: There is no home folder.
    """
    try:
        return path.expanduser()
    except RuntimeError as error:
        raise InvalidArgument(
            f"{path}: this program has no home folder (HOME): write the whole path"
        ) from error


def for_json(name: str, value: object) -> Any:
    """`value` as JSON has it: NumPy's values, paths and times become numbers, lists and texts.

    Raises:
        InvalidArgument: JSON cannot hold it.
    """
    import json  # here, as in `_plain`: most programs note nothing

    try:
        return json.loads(json.dumps(value, default=_plain))
    except (TypeError, ValueError, RecursionError) as error:
        raise InvalidArgument(
            f"{name} = {shown(value)}: give what JSON can hold (numbers, texts, lists, mappings "
            f"with texts as keys): {error}"
        ) from error


def _plain(value: object) -> object:
    """What `json` does not know, as something that it does."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    from datetime import date, time

    if isinstance(value, (date, time)):  # and datetime
        return value.isoformat()
    if isinstance(value, Enum):
        return value.name
    tolist = getattr(value, "tolist", None)  # of NumPy's arrays and scalars
    if callable(tolist):
        return tolist()
    raise TypeError(f"it holds a {type(value).__name__}")


def flag(name: str, value: object) -> bool:
    """Return `value` if it is a bool.

    Raises:
        InvalidArgument: It is not.
    """
    if isinstance(value, bool):
        return value
    raise InvalidArgument(f"{name} = {shown(value)}: give True or False")
