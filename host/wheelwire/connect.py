"""Opens a robot: by its address, by a YAML file, or by the name of its driver."""

from __future__ import annotations

import os
import re
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, overload

from .arguments import path as checked_path
from .arguments import text
from .errors import DriverUnavailable, InvalidArgument, InvalidCommand, RobotNotNamed, meant, shown
from .link.ports import port_name

# Drivers, files and recordings are imported when used: the import of wheelwire stays quick.
if TYPE_CHECKING:
    from collections.abc import Iterable

    from .drivers.arguments import (
        L298NArguments,
        MockArguments,
        PigpioArguments,
        ReplayArguments,
        SerialArguments,
        arguments_of,
    )
    from .drivers.l298n import L298NDriver
    from .drivers.mock import MockDriver
    from .drivers.pigpio import PigpioDriver
    from .drivers.replay import ReplayDriver
    from .drivers.serial import SerialDriver
    from .robot.robot import Robot

ENVIRONMENT = "WHEELWIRE_ROBOT"
"""Names the robot where no address is given."""
MOCK = "mock"
ADDRESS_KINDS = (
    "a port, socket://HOST:PORT, unix:PATH, a board's id, a robot's YAML file, a recording (.mcap) "
    "or mock"
)
BOARD_PORTS = "/dev/ttyUSB*,/dev/ttyACM*"
"""Where a board is looked for by its id: the ports of USB adapters and of chips with USB."""
_ROBOT_FILES = (".yaml", ".yml")
_RECORDINGS = ".mcap"
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


def connect(robot: str | os.PathLike[str] | None = None) -> Robot:
    """Open a robot by its address, as the commands do: for `with`, which closes it, or without.

    Args:
        robot: A port, such as `/dev/ttyUSB0`; `socket://HOST:PORT`; `unix:PATH`; a board's id, as
            `wheelwire info` shows it; a robot's YAML file; a recording, `FILE.mcap`; or `mock`, a
            simulated robot. None: the one that the environment's WHEELWIRE_ROBOT names.

    For a board's id, this opens all free USB ports to ask which board is there. To limit it to some
    ports, use a robot's file with `serial.board_id`.

    Raises:
        InvalidArgument: This is not an address.
        RobotNotNamed: No address was given, and WHEELWIRE_ROBOT is not set.
        ConfigurationError: The robot's file is missing or invalid.
        PortUnavailable: The port cannot be opened, or the board is at none.
        WheelwireError: As `open_driver`.
    """
    name, options = driver_at(named(robot))
    return open_driver(name, **options)


def named(robot: str | os.PathLike[str] | None) -> str:
    """The given address, or else the one in the environment.

    Raises:
        InvalidArgument: It is empty, or of another type.
        RobotNotNamed: No address was given.
    """
    if robot is None:
        robot = os.environ.get(ENVIRONMENT)
        if not robot:
            raise RobotNotNamed(f"no robot was named: give {ADDRESS_KINDS}, or set {ENVIRONMENT}")
    if robot == "":  # an unset shell variable; taking the default would move another robot
        raise InvalidArgument(f"ROBOT is empty (an unset variable?): give {ADDRESS_KINDS}")
    return port_name(text("ROBOT", robot, "/dev/ttyUSB0"))


def driver_at(
    address: str, *, baud_rate: int | None = None, bare: bool = False
) -> tuple[str, dict[str, Any]]:
    """The driver of the robot at an address, and its options. Opens no port.

    Args:
        address: See `connect`.
        baud_rate: Baud rate of a port, to be tried first; None: the default.
        bare: Ignore what in its file would change a serial robot or prevent opening it: for
            commands that only look at the robot or its parameters, or stop it.

    Raises:
        InvalidArgument: A baud rate was given, but the address is not a port; or the baud rate is
            invalid.
        ConfigurationError: The robot's file is missing or invalid.
        DriverUnavailable: No driver has the name in its file.
    """
    # Anything but a file or mock is a port; its transport says which kind.
    if address != MOCK and not is_robot_file(address) and not is_recording(address):
        _refuse_a_part(address)
        return "serial", _port_options(address, baud_rate)
    if baud_rate is not None:
        raise InvalidArgument(
            f"a baud rate is only for ports, not for {address}: leave it out; "
            "in a robot's file, set serial.baud_rate"
        )
    if address == MOCK:
        return MOCK, {}
    if is_recording(address):
        return "replay", {"file": address}
    from .tools.files.robot import driver_of, load_config

    name, options = driver_of(load_config(address), address)
    if bare and name == "serial":
        # The other drivers start a core of their own, which has no parameters before.
        for changing in ("parameters", "board", "stream_rate_hz"):
            del options[changing]
    return name, options


def _refuse_a_part(address: str) -> None:
    """Raise for the name of a driver, a board or a motor driver, which is not a robot's address."""
    if "/" in address or ":" in address or Path(address).exists():
        return
    from .tools.files.board import shipped_boards

    near = meant(address, [*shipped_boards(), *driver_names()], cutoff=0.75)
    if near == MOCK:
        raise InvalidArgument(f"{address} is no address; did you mean {MOCK}, a simulated robot?")
    if near:
        raise InvalidArgument(
            f"{address} is a part of a robot, not its address: name the port of the ESP32, or give "
            f"{ADDRESS_KINDS}; did you mean {near} as the `driver` or `board` in a robot's "
            "file, or a board's name for `wheelwire board write`?"
        )


def is_robot_file(address: str) -> bool:
    """Whether an address is a robot's file."""
    return address.lower().endswith(_ROBOT_FILES)


def is_recording(address: str) -> bool:
    """Whether an address is a recording."""
    return address.lower().endswith(_RECORDINGS)


def is_board_id(address: str) -> bool:
    """Whether an address is a board's id."""
    return bool(re.fullmatch("[0-9a-fA-F]{12}", address)) and not Path(address).exists()


def _port_options(address: str, baud_rate: int | None) -> dict[str, Any]:
    options: dict[str, Any] = {} if baud_rate is None else {"baud_rate": baud_rate}
    if is_board_id(address):
        return {"port": BOARD_PORTS, "board_id": address, **options}
    if Path(address).is_file() or Path(address).is_dir():
        raise InvalidArgument(
            f"{address} is neither a port nor a robot's file, whose name ends in .yaml: "
            f"give {ADDRESS_KINDS}"
        )
    return {"port": address, **options}


def open_robot(file: str | Path | None = None) -> Robot:
    """Open the robot described by a YAML file; by default the built-in `pi4b_robot.yaml`.

    A serial robot receives the file's parameters each time a session opens; they override what it
    has saved. The others start with the file's, and values saved in `store` override these.

    Raises:
        ConfigurationError: The file is missing or invalid.
        WheelwireError: As `open_driver`.
    """
    from .tools.files.robot import driver_of, load_config

    name, options = driver_of(load_config(file), file)
    return open_driver(name, **options)


if TYPE_CHECKING:

    @overload
    @arguments_of(SerialArguments)
    def open_driver(name: Literal["serial"]) -> SerialDriver: ...
    @overload
    @arguments_of(L298NArguments)
    def open_driver(name: Literal["l298n"]) -> L298NDriver: ...
    @overload
    @arguments_of(PigpioArguments)
    def open_driver(name: Literal["pigpio"]) -> PigpioDriver: ...
    @overload
    @arguments_of(MockArguments)
    def open_driver(name: Literal["mock"]) -> MockDriver: ...
    @overload
    @arguments_of(ReplayArguments)
    def open_driver(name: Literal["replay"]) -> ReplayDriver: ...
    @overload
    def open_driver(name: str, *args: Any, record: str | Path | None = None) -> Robot: ...


def open_driver(name: str, *args: Any, record: str | Path | None = None, **options: Any) -> Robot:
    """Open a robot by the name of its driver.

    The built-in drivers send it a zero setpoint and a stop, so that it obeys the first motion that
    is asked for.

    Args:
        name: A built-in driver, or one that an installed package offers as an entry point in the
            group `wheelwire.drivers`.
        *args: The driver's own arguments; see its class.
        record: A file or folder to record to, see docs/recording.md; by default what the
            environment's `WHEELWIRE_RECORD` names, if it is set.
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
        driver: Robot = make(*args, **options)
        return driver
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
    from inspect import Parameter, signature  # here: it is slow to import

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
    from importlib.metadata import entry_points  # here: it is slow to import

    return {point.name: point.value for point in entry_points(group=ENTRY_POINT_GROUP)}


def wanted_recording(record: str | Path | None) -> Path | None:
    """Where to record a robot: `record`, or the path in the environment.

    Raises:
        RecordingError: No file can be made there.
        InvalidArgument: `record` is not a path.
    """
    wanted = os.environ.get(RECORD_VARIABLE) if record is None else record
    if not wanted:
        return None
    from .log.recorder import recording_path

    wanted = checked_path("record", wanted)
    recording_path(wanted)
    return wanted


def record_opened(robot: Robot, path: Path, driver: str, *, is_asked: bool) -> None:
    """Record a robot that was just opened.

    Args:
        robot: The robot.
        path: The file or folder to record to.
        driver: The driver's name.
        is_asked: Whether the program asked for it. The environment asks for all robots, but not
            every one can be recorded.
    """
    if robot.has_device:
        with suppress(*() if is_asked else (InvalidCommand,)):
            robot.record(path, driver)
    elif is_asked:
        raise InvalidArgument(
            f"driver {driver!r} has no link that could be recorded: leave out `record`"
        )
