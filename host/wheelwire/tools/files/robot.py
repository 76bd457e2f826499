"""A robot's file: driver, pins, options and parameters, also under the names of other packages."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from wheelwire_protocol.native import NativeMissingError
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from ...arguments import at_home, is_number
from ...board import Configuration
from ...connect import check_options, driver_class, driver_names
from ...drivers.options import SerialDriverOptions, SerialOptions
from ...drivers.pin_options import GpioOptions, L298NOptions, PigpioDriverOptions, PigpioOptions
from ...errors import ConfigurationError, InvalidArgument, meant, shown
from ...link.ports import UNIX
from ...pi.pins import PIN_NAMES, Pins, check_hardware_pwm
from ...pi.settings import McuSettings
from .board import checked_board, shipped_boards
from .parameters import parameter_value, parameter_values
from .peripherals import SECTIONS, parse_peripherals
from .reading import Section, reading

log = logging.getLogger("wheelwire")

ALIASES = {
    "driver_type": "driver",
    "wheel_base": "parameters.wheel_separation",
    "wheel_radius": "parameters.wheel_radius",
    "cpr": "parameters.counts_per_revolution",
    "max_speed": "parameters.max_velocity_mps",
    "pwm_frequency": "parameters.pwm_frequency_hz",
    "pigpio_host": "pigpio.host",
    "pigpio_port": "pigpio.port",
    "serial_port": "serial.port",
}
"""Top-level names from other packages' files, and the names used here."""
MAX_RPM = "max_rpm"
"""The motor's no-load speed: the wheel's radius makes the velocity feed-forward of it."""
BUILT_IN = ("mock", "l298n", "pigpio", "serial")
OWN_PINS = ("l298n", "pigpio")
"""The drivers that move this computer's pins."""
TOP = ("driver", "store", "board")
_STATIC = "static_feedforward"
_CHOOSE_A_DRIVER = "choose one of mock, l298n, pigpio and serial, as in `driver: serial`"
DEFAULT_FILE = Path(__file__).parent / "pi4b_robot.yaml"


@dataclass(frozen=True)
class RobotConfig:
    """One robot. `parameters` has the file's parameters, under the firmware's names.

    Attributes:
        board: The name or file of a board: in place of `pins`, or, for a serial robot, the one that
            its device has to be on.
        store: File for saved parameters; not for a serial robot, whose device saves its own.
        options: The section of a driver of another package, under the driver's name.
        aliases: The aliases found, and the names that they mean.
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
        # Only for robots on this computer's pins: others open even if the board's file is wrong.
        pins = self.wiring() if self.driver in ("l298n", "pigpio") else self.pins
        local = {"pins": pins, "parameters": self.parameters, "store": store}
        return {
            "mock": {"parameters": self.parameters, "store": store},
            "pigpio": {**asdict(self.pigpio), **local},
            "l298n": {**asdict(self.gpio), **local},
            "serial": {**asdict(self.serial), "board": self.board, "parameters": self.parameters},
        }.get(self.driver) or self._plug_in_options()

    def _plug_in_options(self) -> dict[str, Any]:
        """The options of another package's driver: its section, and the file's other keys."""
        beside = {
            "parameters": self.parameters or None,
            "board": self.board,
            "store": None if self.store is None else at_home(Path(self.store)),
            "pins": None if self.pins == Pins() else self.pins,
        }
        # The driver may not take these, so pass only those that the file has.
        return {**self.options, **{name: it for name, it in beside.items() if it is not None}}


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
    config = RobotConfig(**_values_of(content))
    try:
        SerialDriverOptions(**asdict(config.serial)).checked()
    except InvalidArgument as error:
        raise ConfigurationError(f"serial.{error}") from error
    return config


def _values_of(content: object) -> dict[str, Any]:
    """The fields of a `RobotConfig` by name.

    Raises:
        ConfigurationError: The message begins with the key, and has its value and what is allowed.
    """
    shapes = SECTIONS_OF_DRIVERS
    if content is None:
        raise ConfigurationError(f"the file is empty; {_CHOOSE_A_DRIVER}")
    # Before the check of keys, which would call the node's name at the top an unknown key.
    if isinstance(content, Mapping) and any(
        isinstance(node, Mapping) and "ros__parameters" in node for node in content.values()
    ):
        raise ConfigurationError(
            "this is a ROS parameter file: start the node with it (params_file:=...); "
            "a robot's own file has `driver:`, not `ros__parameters:`"
        )
    names = {section: [field.name for field in fields(shape)] for section, shape in shapes.items()}
    names["pins"] = list(PIN_NAMES)
    known = [*TOP, *names, *SECTIONS, "parameters", *ALIASES, MAX_RPM]
    # A driver of another package has a section of its own name.
    own = content.get("driver", content.get("driver_type")) if isinstance(content, Mapping) else ""
    plug_in = [own] if isinstance(own, str) and own not in (*BUILT_IN, *known) else []
    file = Section(content, [*known, *plug_in], "", {**names, "parameters": PARAMETER_BY_NAME})
    aliases = _replace_aliases(file.values)
    sections = {name: Section(_section(file.values, name), names[name], name) for name in names}
    found: dict[str, Any] = {name: file.text(name) for name in TOP}
    found |= {name: sections[name].fill(shape) for name, shape in shapes.items()}
    peripherals = parse_peripherals(file)
    found["pins"] = replace(Pins(**sections["pins"].values), peripherals=peripherals)
    found["parameters"] = parameter_values(file.get("parameters", None))
    for name in plug_in:
        found["options"] = _section(file.values, name)
    # Last: a wrong value is reported first, whether or not a driver is named.
    if {"board", "pins"} <= file.values.keys():
        raise ConfigurationError("board and pins are both given: remove one of them")
    if found["board"] is None:
        _check_pins(found["driver"], found["pins"])
    if found["driver"] is None:
        raise ConfigurationError(f"driver is missing; {_CHOOSE_A_DRIVER}")
    for name in SECTIONS:
        if name in file.values and (found["board"] is not None or found["driver"] not in OWN_PINS):
            raise ConfigurationError(
                f"{name}: name it in the board's file; a robot's file has it only beside the pins "
                "of l298n and pigpio"
            )
    for foreign, name in aliases.items():
        log.info("%s is read as %s", foreign, name)
    return {**found, "aliases": aliases}


def _check_pins(driver: str | None, pins: Configuration) -> None:
    if driver == "pigpio":
        check_hardware_pwm(pins)  # as a board, it may use the daemon's own timing
    if driver not in OWN_PINS:
        return
    # The driver checks these rules, too, but cannot name a line of the file.
    try:
        problems = pins.problems()
    except NativeMissingError:
        return  # the driver says what to install
    if problems:
        raise ConfigurationError("; ".join(problems))


def _section(values: Mapping[str, Any], name: str) -> dict[str, Any]:
    """A copy of a section; a name with nothing below it is an empty section."""
    content = values.get(name) or {}
    return Section(content, content, name).values


def _replace_aliases(values: dict[str, Any]) -> dict[str, str]:
    """Replace aliases by the names that they mean; returns the aliases found, with names."""
    given = {name: values.pop(name) for name in (*ALIASES, MAX_RPM) if name in values}
    found = {name: ALIASES.get(name, "parameters.velocity_feedforward") for name in given}
    for foreign, name in found.items():
        section, _, key = name.rpartition(".")
        if section:
            values[section] = _section(values, section)
        target = values[section] if section else values
        if key in target:
            raise ConfigurationError(
                f"{foreign} = {shown(given[foreign])}: {name} is given too; remove one of them"
            )
        # MAX_RPM is the last alias: it needs the wheel's radius, which may be an alias, too.
        target[key] = _feedforward(given[foreign], target) if foreign == MAX_RPM else given[foreign]
    return found


def _feedforward(rpm: Any, parameters: Mapping[str, Any]) -> float:
    """Duty per m/s: full duty less the static friction's, divided by the no-load speed."""
    if not is_number(rpm) or rpm <= 0:
        raise ConfigurationError(f"{MAX_RPM} = {shown(rpm)}: it must be a number above 0")
    defaults = {name: PARAMETER_BY_NAME[name].default for name in ("wheel_radius", _STATIC)}
    section = Section({**defaults, **parameters}, PARAMETER_BY_NAME, "parameters")
    # v0 = w0 r, from "The four equations" in docs/pi-pins.md.
    no_load_mps = rpm * 2 * math.pi / 60 * parameter_value(section, "wheel_radius")
    return (1 - parameter_value(section, _STATIC)) / float(no_load_mps)


SECTIONS_OF_DRIVERS = {"pigpio": PigpioOptions, "serial": SerialOptions, "gpio": GpioOptions}
