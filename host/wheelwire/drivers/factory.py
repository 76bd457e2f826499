"""Finds and opens drivers by name."""

from __future__ import annotations

import os
from importlib import import_module
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, Literal, overload

from ..errors import DriverUnavailable, InvalidArgument, meant, shown

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from .base import BaseDriver
    from .l298n import L298NDriver
    from .mock import MockDriver
    from .options import arguments_of
    from .pigpio import PigpioDriver
    from .replay import ReplayDriver
    from .serial import SerialDriver

ENTRY_POINT_GROUP = "wheelwire.drivers"
RECORD_VARIABLE = "WHEELWIRE_RECORD"
"""The environment's variable that says where to record every robot that a program opens."""

_BUILT_IN = {
    "l298n": "wheelwire.drivers.l298n:L298NDriver",
    "mock": "wheelwire.drivers.mock:MockDriver",
    "pigpio": "wheelwire.drivers.pigpio:PigpioDriver",
    "replay": "wheelwire.drivers.replay:ReplayDriver",
    "serial": "wheelwire.drivers.serial:SerialDriver",
}


if TYPE_CHECKING:

    @overload
    @arguments_of(SerialDriver)
    def open_driver(name: Literal["serial"]) -> SerialDriver: ...
    @overload
    @arguments_of(L298NDriver)
    def open_driver(name: Literal["l298n"]) -> L298NDriver: ...
    @overload
    @arguments_of(PigpioDriver)
    def open_driver(name: Literal["pigpio"]) -> PigpioDriver: ...
    @overload
    @arguments_of(MockDriver)
    def open_driver(name: Literal["mock"]) -> MockDriver: ...
    @overload
    @arguments_of(ReplayDriver)
    def open_driver(name: Literal["replay"]) -> ReplayDriver: ...
    @overload
    def open_driver(
        name: str, *args: Any, record: str | Path | None = None, **options: Any
    ) -> BaseDriver: ...


def open_driver(
    name: str, *args: Any, record: str | Path | None = None, **options: Any
) -> BaseDriver:
    """Open a robot by the name of its driver.

    The built-in drivers send it a zero setpoint and a stop, so that it obeys the first motion that
    is asked for.

    Args:
        name: A built-in driver, or one that an installed package offers as an entry point in the
            group `wheelwire.drivers`.
        *args: The driver's own arguments; see its class.
        record: A file, or a folder, to which the robot's day is recorded, see docs/recording.md;
            by default what the environment's `WHEELWIRE_RECORD` names, if it is set.
        **options: As `args`, by name.

    Raises:
        DriverUnavailable: No driver has this name, or what it needs is not installed or not there.
        InvalidArgument: The driver has no such option, or needs one that is missing.
        RecordingError: The recording's file cannot be made.
        WheelwireError: What the driver itself raises.
    """
    make = driver_class(name)
    check_options(name, make, options, *args)
    if record is None and RECORD_VARIABLE not in os.environ:
        driver: BaseDriver = make(*args, **options)
        return driver
    from .recording import record_opened, wanted_recording  # here, for most record nothing

    recording = wanted_recording(record)  # first: a robot that moves is not opened for nothing
    driver = make(*args, **options)
    if recording is not None:
        try:
            record_opened(driver, recording, name, is_asked=record is not None)
        except BaseException:
            driver.close()
            raise
    return driver


def driver_names() -> list[str]:
    """The names that `open_driver` knows on this machine."""
    return sorted({**_plug_ins(), **_BUILT_IN})


def driver_class(name: str) -> Any:
    """What makes the driver of this name; raises `DriverUnavailable`."""
    # First the built-in ones: to find the others all installed packages are looked through.
    target = (_BUILT_IN.get(name) or _plug_ins().get(name)) if isinstance(name, str) else None
    if target is None:
        known = driver_names()
        near = meant(name, known)
        hint = f"did you mean {near!r}? " if near else ""
        raise DriverUnavailable(
            f"no driver is called {shown(name)}; {hint}there are: {', '.join(known)}"
        )
    module, _, attribute = target.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except ImportError as error:
        raise DriverUnavailable(
            f"driver {name!r} needs the module {error.name!r}: install the package that has it"
        ) from error


def check_options(name: str, make: Any, options: dict[str, Any], *args: Any) -> None:
    """Raise `InvalidArgument` if `make` does not take these options."""
    # Before the call: a TypeError from inside the driver must not be mistaken for a wrong option.
    try:
        expected = signature(make)
    except ValueError:  # it is not written in Python, and checks them itself
        return
    taken = expected.parameters
    takes_any = any(parameter.kind is Parameter.VAR_KEYWORD for parameter in taken.values())
    for option in [] if takes_any else options:
        if option not in taken:
            raise InvalidArgument(
                f"driver {name!r} has no option {option!r}: {_suggestion(option, taken)}"
            )
    try:
        expected.bind(*args, **options)
    except TypeError as error:
        known = ", ".join(taken)
        raise InvalidArgument(f"driver {name!r}: {error}; its options are: {known}") from None


def _suggestion(option: str, known: Iterable[str]) -> str:
    near = meant(option, known)
    return f"did you mean {near!r}?" if near else f"its options are: {', '.join(known)}"


def _plug_ins() -> dict[str, str]:
    from importlib.metadata import entry_points  # here, for it is slow to import

    return {point.name: point.value for point in entry_points(group=ENTRY_POINT_GROUP)}
