"""What a caller gave, checked: a number, whole or not, within bounds; of whatever type it was."""

from __future__ import annotations

import math
import os
from numbers import Real
from pathlib import Path

from .errors import InvalidArgument, shown

LONGEST_WAIT_S = 3600.0
"""No call waits longer; and no setpoint lives longer, for any device shortens it further."""


def is_number(value: object) -> bool:
    """Whether it is a finite real number, of Python's or NumPy's types. A bool is none."""
    if type(value) is not float and (isinstance(value, bool) or not isinstance(value, Real)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an int that no float can hold
        return False


def number(
    name: str, value: object, low: float, high: float, error: type[InvalidArgument]
) -> float:
    """`value` as a float, if it is a finite number from `low` to `high`.

    Raises:
        InvalidArgument: It is none, as `error`.
    """
    if is_number(value):
        checked = float(value)  # type: ignore[arg-type]
        if low <= checked <= high:
            return checked
    raise error(f"{name} = {shown(value)}: give a number from {low:g} to {high:g}")


def whole(name: str, value: object, low: int, high: int) -> int:
    """`value` as an int, if it is a whole number from `low` to `high`.

    Raises:
        InvalidArgument: It is none.
    """
    if is_number(value):
        checked = int(value)  # type: ignore[call-overload]
        if checked == value and low <= checked <= high:
            return int(checked)
    raise InvalidArgument(f"{name} = {shown(value)}: give a whole number from {low} to {high}")


def timeout_s(name: str, value: object) -> float:
    """`value` as a time to wait, in seconds.

    Raises:
        InvalidArgument: It is none: nothing waits for ever.
    """
    return number(name, value, 0.0, LONGEST_WAIT_S, InvalidArgument)


def text(name: str, value: object, example: str) -> str:
    """`value` as a string that is not empty; a path becomes one.

    Raises:
        InvalidArgument: It is none.
    """
    if isinstance(value, os.PathLike):
        value = os.fspath(value)
    if isinstance(value, str) and value:
        return value
    raise InvalidArgument(f"{name} = {shown(value)}: give a name, such as {example}")


def path(name: str, value: object) -> Path:
    """`value` as a path.

    Raises:
        InvalidArgument: It is none.
    """
    if isinstance(value, (str, os.PathLike)):
        return Path(os.fspath(value))
    raise InvalidArgument(f"{name} = {shown(value)}: give a path")


def flag(name: str, value: object) -> bool:
    """`value`, if it is a bool.

    Raises:
        InvalidArgument: It is none.
    """
    if isinstance(value, bool):
        return value
    raise InvalidArgument(f"{name} = {shown(value)}: give True or False")
