"""Drivers by name."""

from __future__ import annotations

from difflib import get_close_matches
from importlib import import_module
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, Literal, overload

from ..errors import DriverUnavailable, InvalidArgument, shown

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from ..board import BoardDescription
    from .base import BaseDriver
    from .l298n import L298NDriver
    from .mock import MockDriver
    from .pigpio import PigpioDriver
    from .serial import SerialDriver

ENTRY_POINT_GROUP = "wheelwire.drivers"

_BUILT_IN = {
    "l298n": "wheelwire.drivers.l298n:L298NDriver",
    "mock": "wheelwire.drivers.mock:MockDriver",
    "pigpio": "wheelwire.drivers.pigpio:PigpioDriver",
    "serial": "wheelwire.drivers.serial:SerialDriver",
}


@overload
def open_driver(
    name: Literal["serial"],
    *,
    port: str,
    baud_rate: int = ...,
    connect_timeout: float = ...,
    stream_rate_hz: int | None = ...,
    board_id: str | None = ...,
    any_board: bool = ...,
    board: str | Path | BoardDescription | None = ...,
    parameters: Mapping[str, float] | None = ...,
) -> SerialDriver: ...
@overload
def open_driver(
    name: Literal["l298n"],
    *,
    pins: BoardDescription | None = ...,
    pwm_chip: int | None = ...,
    parameters: Mapping[str, float] | None = ...,
    store: Path | None = ...,
    pwm_directory: Path = ...,
    core_timeout_ms: int = ...,
) -> L298NDriver: ...
@overload
def open_driver(
    name: Literal["pigpio"],
    *,
    host: str = ...,
    port: int = ...,
    pins: BoardDescription | None = ...,
    parameters: Mapping[str, float] | None = ...,
    store: Path | None = ...,
    core_timeout_ms: int = ...,
) -> PigpioDriver: ...
@overload
def open_driver(
    name: Literal["mock"],
    *,
    realtime: bool = ...,
    parameters: Mapping[str, float] | None = ...,
    store: Path | None = ...,
) -> MockDriver: ...
@overload
def open_driver(name: str, **options: Any) -> BaseDriver: ...
def open_driver(name: str, **options: Any) -> BaseDriver:
    """Open a robot by the name of its driver.

    Args:
        name: A built-in driver, or one that an installed package offers as an entry point in the
            group `wheelwire.drivers`.
        **options: The driver's own arguments; see its class.

    Raises:
        DriverUnavailable: No driver has this name, or what it needs is not installed or not there.
        InvalidArgument: The driver has no such option, or needs one that is missing.
        WheelwireError: What the driver itself raises.
    """
    make = driver_class(name)
    check_options(name, make, options)
    driver: BaseDriver = make(**options)
    return driver


def driver_names() -> list[str]:
    """The names that `open_driver` knows on this machine."""
    return sorted({**_plug_ins(), **_BUILT_IN})


def driver_class(name: str) -> Any:
    """What makes the driver of this name; raises `DriverUnavailable`."""
    # First the built-in ones: to find the others all installed packages are looked through.
    target = (_BUILT_IN.get(name) or _plug_ins().get(name)) if isinstance(name, str) else None
    if target is None:
        known = ", ".join(driver_names())
        raise DriverUnavailable(f"no driver is called {shown(name)}; there are: {known}")
    module, _, attribute = target.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except ImportError as error:
        raise DriverUnavailable(
            f"driver {name!r} needs the module {error.name!r}: install what it belongs to"
        ) from error


def check_options(name: str, make: Any, options: dict[str, Any]) -> None:
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
        expected.bind(**options)
    except TypeError as error:
        known = ", ".join(taken)
        raise InvalidArgument(f"driver {name!r}: {error}; its options are: {known}") from None


def _suggestion(option: str, known: Iterable[str]) -> str:
    near = get_close_matches(option, list(known), n=1, cutoff=0.5)
    return f"did you mean {near[0]!r}?" if near else f"its options are: {', '.join(known)}"


def _plug_ins() -> dict[str, str]:
    from importlib.metadata import entry_points  # here, for it is slow to import

    return {point.name: point.value for point in entry_points(group=ENTRY_POINT_GROUP)}
