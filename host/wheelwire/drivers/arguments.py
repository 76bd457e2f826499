"""The arguments of `open_driver` for each driver, for type checkers alone: nothing imports this."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

from .mock import MockOptions
from .options import SerialDriverOptions
from .pin_options import L298NOptions, PigpioDriverOptions
from .replay import ReplayOptions

P = ParamSpec("P")
_Name = TypeVar("_Name")
_Result = TypeVar("_Result")


def arguments_of(
    options: Callable[P, object],
) -> Callable[[Callable[[_Name], _Result]], Callable[Concatenate[_Name, P], _Result]]:
    """A function of a driver's name takes the driver's options behind it."""
    raise NotImplementedError(options)


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """What `open_driver` takes for every driver."""

    record: str | Path | None = None


@dataclass(frozen=True)
class SerialArguments(SerialDriverOptions, Recorded):
    """Of `serial`."""


@dataclass(frozen=True)
class L298NArguments(L298NOptions, Recorded):
    """Of `l298n`."""


@dataclass(frozen=True)
class PigpioArguments(PigpioDriverOptions, Recorded):
    """Of `pigpio`."""


@dataclass(frozen=True)
class MockArguments(MockOptions, Recorded):
    """Of `mock`."""


@dataclass(frozen=True)
class ReplayArguments(ReplayOptions, Recorded):
    """Of `replay`."""
