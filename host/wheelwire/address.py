"""ROBOT: the one address of a robot, written the same way in programs and on the command line."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import text
from .errors import InvalidArgument, RobotNotNamed

if TYPE_CHECKING:
    from .drivers.base import BaseDriver

ENVIRONMENT = "WHEELWIRE_ROBOT"
"""Names the robot where no address is given."""
MOCK = "mock"
ADDRESS_KINDS = "a port, socket://HOST:PORT, unix:PATH, a board's id, a robot's YAML file or mock"
BOARD_PORTS = "/dev/ttyUSB*,/dev/ttyACM*"
"""Where a board is looked for by its id: the ports of USB adapters and of chips with USB."""
_FILES = (".yaml", ".yml")


def connect(robot: str | os.PathLike[str] | None = None) -> BaseDriver:
    """Open a robot by its address, as the commands do: for `with`, which closes it, or without.

    Args:
        robot: A port, such as `/dev/ttyUSB0`; `socket://HOST:PORT`; `unix:PATH`; a board's id, as
            `wheelwire info` shows it; a robot's YAML file; or `mock`, a simulated robot. None: the
            one that the environment's WHEELWIRE_ROBOT names.

    For a board's id all free USB ports are opened to ask who is there. Where that is not wanted, a
    robot's file says which ports those are, with `serial.board_id`.

    Raises:
        InvalidArgument: This is no address.
        RobotNotNamed: No address was given, and WHEELWIRE_ROBOT is not set.
        ConfigurationError: The robot's file is missing or invalid.
        PortUnavailable: The port cannot be opened, or the board is at none.
        WheelwireError: As `open_driver`.
    """
    from .drivers.factory import open_driver

    name, options = driver_at(named(robot))
    return open_driver(name, **options)


def named(robot: str | os.PathLike[str] | None) -> str:
    """The address that was given, else the one in the environment.

    Raises:
        InvalidArgument: It is empty, or of another type.
        RobotNotNamed: There is none.
    """
    if robot is None:
        robot = os.environ.get(ENVIRONMENT)
        if not robot:
            raise RobotNotNamed(f"no robot was named: give {ADDRESS_KINDS}, or set {ENVIRONMENT}")
    if robot == "":  # an unset shell variable; taking the default would move another robot
        raise InvalidArgument(f"ROBOT is empty (an unset variable?): give {ADDRESS_KINDS}")
    return text("ROBOT", robot, "/dev/ttyUSB0")


def driver_at(
    address: str, *, baud_rate: int | None = None, bare: bool = False
) -> tuple[str, dict[str, Any]]:
    """The driver of the robot at an address, and its options. Opens no port.

    Args:
        address: See `connect`.
        baud_rate: Of a port, to be tried first; None: the default.
        bare: Nothing in its file is to change a serial robot, or keep it from being opened: for
            those who only look at the robot or its parameters, or stop it.

    Raises:
        InvalidArgument: A baud rate was given, but the address is not a port; or this is none.
        ConfigurationError: The robot's file is missing or invalid.
        DriverUnavailable: No driver has the name in its file.
    """
    # Whatever is neither a file nor mock is a port: what kind of one, its transport tells.
    if address != MOCK and not is_robot_file(address):
        return "serial", _port_options(address, baud_rate)
    if baud_rate is not None:
        raise InvalidArgument(
            f"a baud rate is only for ports, not for {address}: leave it out; "
            "in a robot's file, set serial.baud_rate"
        )
    if address == MOCK:
        return MOCK, {}
    from .config import driver_of, load_config  # here, because their imports are slow

    name, options = driver_of(load_config(address), address)
    if bare and name == "serial":
        # The other drivers start a core of their own, which has no parameters before.
        for changing in ("parameters", "board", "stream_rate_hz"):
            del options[changing]
    return name, options


def is_robot_file(address: str) -> bool:
    """Whether an address is a robot's file."""
    return address.lower().endswith(_FILES)


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
