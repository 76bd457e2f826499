"""A robot by its address, which is written the same way everywhere, or by a YAML file."""

from __future__ import annotations

import os
import re
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import at_home, text
from .board import Configuration
from .drivers.factory import check_options, driver_class, driver_names, open_driver
from .drivers.options import SerialDriverOptions, SerialOptions
from .drivers.pin_options import GpioOptions, L298NOptions, PigpioDriverOptions, PigpioOptions
from .errors import ConfigurationError, InvalidArgument, RobotNotNamed, meant, shown
from .files.board import checked_board, shipped_boards
from .files.pins import Pins
from .files.reading import reading
from .files.robot import BUILT_IN, OWN_PINS, parse_robot
from .link.port_name import UNIX, port_name
from .linux_mcu.settings import McuSettings

if TYPE_CHECKING:
    from .drivers.base import BaseDriver

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
DEFAULT_FILE = Path(__file__).parent / "files" / "pi4b_robot.yaml"


@dataclass(frozen=True)
class RobotConfig:
    """One robot. `parameters` has those in the file, under the firmware's names.

    Attributes:
        board: The name or file of a board: in place of `pins`, or, for a serial robot, the one that
            its device has to be on.
        store: File for saved parameters; not for a serial robot, whose device saves its own.
        options: The section of a driver of another package, under the driver's name.
        aliases: The aliases that were found, and the names that they stand for.
    """

    driver: str = "pigpio"
    pins: Configuration = field(default_factory=Pins)
    board: str | None = None
    pigpio: PigpioOptions = field(default_factory=PigpioOptions)
    serial: SerialOptions = field(default_factory=SerialOptions)
    gpio: GpioOptions = field(default_factory=GpioOptions)
    store: str | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)

    def wiring(self) -> Configuration:
        """The wiring of this computer's own pins.

        Raises:
            ConfigurationError: The board cannot be used.
        """
        return self.pins if self.board is None else checked_board(self.board)

    def driver_options(self) -> dict[str, Any]:
        """The arguments of this robot's driver."""
        store = None if self.store is None else at_home(Path(self.store))
        # Only where pins are moved: other robots open whatever is wrong with the board's file.
        pins = self.wiring() if self.driver in ("l298n", "pigpio") else self.pins
        local = {"pins": pins, "parameters": self.parameters, "store": store}
        return {
            "mock": {"parameters": self.parameters, "store": store},
            "pigpio": {**asdict(self.pigpio), **local},
            "l298n": {**asdict(self.gpio), **local},
            "serial": {**asdict(self.serial), "board": self.board, "parameters": self.parameters},
        }.get(self.driver) or self._plug_in_options()

    def _plug_in_options(self) -> dict[str, Any]:
        """The options of another package's driver: its section, and what the file has beside it."""
        beside = {
            "parameters": self.parameters or None,
            "board": self.board,
            "store": None if self.store is None else at_home(Path(self.store)),
            "pins": None if self.pins == Pins() else self.pins,
        }
        # It may take none of them, so it is only given those that the file has.
        return {**self.options, **{name: it for name, it in beside.items() if it is not None}}


def connect(robot: str | os.PathLike[str] | None = None) -> BaseDriver:
    """Open a robot by its address, as the commands do: for `with`, which closes it, or without.

    Args:
        robot: A port, such as `/dev/ttyUSB0`; `socket://HOST:PORT`; `unix:PATH`; a board's id, as
            `wheelwire info` shows it; a robot's YAML file; a recording, `FILE.mcap`; or `mock`, a
            simulated robot. None: the one that the environment's WHEELWIRE_ROBOT names.

    For a board's id all free USB ports are opened to ask who is there. Where that is not wanted, a
    robot's file says which ports those are, with `serial.board_id`.

    Raises:
        InvalidArgument: This is no address.
        RobotNotNamed: No address was given, and WHEELWIRE_ROBOT is not set.
        ConfigurationError: The robot's file is missing or invalid.
        PortUnavailable: The port cannot be opened, or the board is at none.
        WheelwireError: As `open_driver`.
    """
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
    return port_name(text("ROBOT", robot, "/dev/ttyUSB0"))


def driver_at(
    address: str, *, baud_rate: int | None = None, bare: bool = False
) -> tuple[str, dict[str, Any]]:
    """The driver of the robot at an address, and its options. Opens no port.

    Args:
        address: See `connect`.
        baud_rate: Baud rate of a port, to be tried first; None: the default.
        bare: Nothing in its file is to change a serial robot, or keep it from being opened: for
            those who only look at the robot or its parameters, or stop it.

    Raises:
        InvalidArgument: A baud rate was given, but the address is not a port; or this is none.
        ConfigurationError: The robot's file is missing or invalid.
        DriverUnavailable: No driver has the name in its file.
    """
    # Whatever is neither a file nor mock is a port: what kind of one, its transport tells.
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
    name, options = driver_of(load_config(address), address)
    if bare and name == "serial":
        # The other drivers start a core of their own, which has no parameters before.
        for changing in ("parameters", "board", "stream_rate_hz"):
            del options[changing]
    return name, options


def _refuse_a_part(address: str) -> None:
    """Raise for the name of a driver, a board or a motor driver, which is no place of a robot."""
    if "/" in address or ":" in address or Path(address).exists():
        return
    known = [*shipped_boards(), *OWN_PINS]
    if near := meant(address, known, cutoff=0.75):
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


def open_robot(file: str | Path | None = None) -> BaseDriver:
    """Open the robot described by a YAML file; by default the built-in `pi4b_robot.yaml`.

    A serial robot receives the file's parameters each time a session opens; they override what it
    has saved. The others start with the file's, and values saved in `store` override these.

    Raises:
        ConfigurationError: The file is missing or invalid.
        WheelwireError: As `open_driver`.
    """
    name, options = driver_of(load_config(file), file)
    return open_driver(name, **options)


def driver_of(config: RobotConfig, file: str | Path | None) -> tuple[str, dict[str, Any]]:
    """The driver of a robot, and its options; `file` is where they are from.

    Raises:
        ConfigurationError: The driver does not take an option in the file.
        DriverUnavailable: No driver has this name, or what it needs is not installed.
    """
    options = config.driver_options()
    if config.driver not in BUILT_IN:  # those were checked with the file
        try:
            check_options(config.driver, driver_class(config.driver), options)
        except InvalidArgument as error:
            raise ConfigurationError(f"{file}: {error}") from error
    return config.driver, options


def service_settings(config: RobotConfig, address: str) -> McuSettings:
    """The settings of a process that serves this robot at `address`, `unix:PATH`.

    Raises:
        ConfigurationError: The robot does not use this computer's pins, or the address is not
            `unix:PATH`.
        DriverUnavailable: The core's library is missing.
    """
    path = address.removeprefix(UNIX)
    if path == address or not path:
        raise ConfigurationError(
            f"listen = {address!r}: it must be unix:PATH, such as unix:/run/wheelwire.sock"
        )
    options = {"l298n": L298NOptions, "pigpio": PigpioDriverOptions}.get(config.driver)
    if options is None:
        raise ConfigurationError(f"driver = {config.driver!r}: a service needs l298n or pigpio")
    settings: McuSettings = options(**config.driver_options()).checked()
    return replace(settings, listen=str(Path(path).absolute()))


def load_config(file: str | Path | None = None) -> RobotConfig:
    """Read and check a YAML file; by default the built-in `pi4b_robot.yaml`.

    Raises:
        ConfigurationError: The message has the key, the value and what is allowed.
    """
    if file is not None and not isinstance(file, (str, Path)):
        raise ConfigurationError(f"{shown(file)} is not a file: give a path")
    source = DEFAULT_FILE if file is None else at_home(Path(file))
    with reading(source, "robot") as content:
        config = parse_config(content)
        if config.driver not in BUILT_IN and config.driver not in driver_names():
            near = meant(config.driver, driver_names())
            hint = f"did you mean {near}? " if near else ""
            raise ConfigurationError(
                f"driver = {shown(config.driver)}: no driver is called that; {hint}"
                f"there are {', '.join(driver_names())}"
            )
    # The name of a built-in board is not a path, even where a file has the same name.
    if config.board is None or config.board in shipped_boards():
        return config
    # Relative to this file.
    return replace(config, board=str(source.parent / at_home(Path(config.board))))


def parse_config(content: object) -> RobotConfig:
    """Check the content of a file; raises as `load_config`."""
    config = RobotConfig(**parse_robot(content, _SECTIONS))
    try:
        SerialDriverOptions(**asdict(config.serial)).checked()
    except InvalidArgument as error:
        raise ConfigurationError(f"serial.{error}") from error
    return config


_SECTIONS = {"pigpio": PigpioOptions, "serial": SerialOptions, "gpio": GpioOptions}
