"""A robot described by one YAML file: driver, pins and parameters.

The parameters and their bounds are the firmware's. Common names from other packages are accepted
as aliases and reported.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from .arguments import top_level
from .board import BoardDescription
from .board_file import checked_board, shipped_boards
from .drivers.factory import check_options, driver_class, driver_names, open_driver
from .drivers.serial import DEFAULT_BAUD_RATE, serial_link
from .errors import (
    ConfigurationError,
    DriverUnavailable,
    InvalidArgument,
    ParameterOutOfRange,
    shown,
)
from .link.base_link import CONNECT_TIMEOUT_S
from .link.transports import UNIX
from .linux_mcu.pins import Pins
from .linux_mcu.settings import CORE_TIMEOUT_MS, PIGPIO_CORE_TIMEOUT_MS, McuSettings
from .linux_mcu.store import converted_store
from .parameters import checked_value
from .yaml_file import reading

if TYPE_CHECKING:
    from .drivers.base import BaseDriver

log = logging.getLogger("wheelwire")

DEFAULT_FILE = "pi4b_params.yaml"
"""In this package."""

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
"""The motor's no-load speed; with the wheel's radius it is the velocity feed-forward."""


@dataclass(frozen=True)
class PigpioOptions:
    """The address of pigpiod."""

    host: str = "localhost"
    port: int = 8888


@dataclass(frozen=True)
class SerialOptions:
    """The port of the ESP32, and what else `open_driver("serial", ...)` takes."""

    port: str = "/dev/ttyUSB0"
    baud_rate: int = DEFAULT_BAUD_RATE
    connect_timeout: float = CONNECT_TIMEOUT_S
    stream_rate_hz: int | None = None
    board_id: str | None = None
    any_board: bool = False


@dataclass(frozen=True)
class GpioOptions:
    """The pins of this computer."""

    pwm_chip: int | None = None


@dataclass(frozen=True)
class RobotConfig:
    """One robot. `parameters` has those in the file, under the firmware's names.

    Attributes:
        board: The name or file of a board: in place of `pins`, or, for a serial robot, the one that
            its device has to be on.
        store: File for saved parameters; not for a serial robot, whose device saves its own.
        options: Of a driver of another package: the section of the driver's name.
        aliases: The aliases that were found, and the names that they stand for.
    """

    driver: str = "pigpio"
    pins: Pins = field(default_factory=Pins)
    board: str | None = None
    pigpio: PigpioOptions = field(default_factory=PigpioOptions)
    serial: SerialOptions = field(default_factory=SerialOptions)
    gpio: GpioOptions = field(default_factory=GpioOptions)
    store: str | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)

    def wiring(self) -> Pins | BoardDescription:
        """What the drivers of this computer's own pins are given.

        Raises:
            ConfigurationError: The board cannot be used.
        """
        return self.pins if self.board is None else checked_board(self.board)

    def driver_options(self) -> dict[str, Any]:
        """The arguments of this robot's driver."""
        store = None if self.store is None else Path(self.store)
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
        """Of a driver of another package: its section, and what the file has beside it."""
        beside = {
            "parameters": self.parameters or None,
            "board": self.board,
            "store": None if self.store is None else Path(self.store),
            "pins": None if self.pins == Pins() else self.pins,
        }
        # It may take none of them, so it is only given those that the file has.
        return {**self.options, **{name: it for name, it in beside.items() if it is not None}}


def open_robot(file: str | Path | None = None) -> BaseDriver:
    """Open the robot described by a YAML file; by default the built-in `pi4b_params.yaml`.

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
    if config.driver not in _BUILT_IN:  # those were checked with the file
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
    if config.driver not in ("l298n", "pigpio"):
        raise ConfigurationError(f"driver = {config.driver!r}: a service needs l298n or pigpio")
    return McuSettings(
        backend="pigpio" if config.driver == "pigpio" else "l298n",
        pins=config.wiring(),
        parameters=config.parameters,
        # Converted here: the process itself reads no other format than the core's.
        store=None if config.store is None else str(converted_store(Path(config.store))),
        pwm_chip=config.gpio.pwm_chip,
        host=config.pigpio.host,
        port=config.pigpio.port,
        core_timeout_ms=PIGPIO_CORE_TIMEOUT_MS if config.driver == "pigpio" else CORE_TIMEOUT_MS,
        listen=str(Path(path).absolute()),
    )


def load_config(file: str | Path | None = None) -> RobotConfig:
    """Read and check a YAML file; by default the built-in `pi4b_params.yaml`.

    Raises:
        ConfigurationError: The message has the key, the value and what is allowed.
        DriverUnavailable: pydantic is not installed.
    """
    if file is not None and not isinstance(file, (str, Path)):
        raise ConfigurationError(f"{shown(file)} is not a file: give a path")
    source = Path(str(files(__package__) / DEFAULT_FILE)) if file is None else Path(file)
    with reading(source, "robot") as content:
        config = parse_config(content)
        if config.driver not in _BUILT_IN and config.driver not in driver_names():
            near = get_close_matches(config.driver, driver_names(), n=1)
            meant = f"did you mean {near[0]}? " if near else ""
            raise ConfigurationError(
                f"driver = {shown(config.driver)}: no driver is called that; {meant}"
                f"there are {', '.join(driver_names())}"
            )
    # The name of a built-in board is not a path, even where a file has the same name.
    if config.board is None or config.board in shipped_boards():
        return config
    return replace(config, board=str(source.parent / config.board))  # relative to this file


def parse_config(content: object) -> RobotConfig:
    """Check the content of a file; raises as `load_config`."""
    if content is None:
        raise ConfigurationError(f"the file is empty; {_CHOOSE_A_DRIVER}")
    # Before the keys: there its top level, a node's name, would only be an unknown one.
    if _is_of_ros(content):
        raise ConfigurationError(
            "this is a ROS parameter file: start the node with it (params_file:=...); "
            "a robot's own file has `driver:`, not `ros__parameters:`"
        )
    plain, aliases = _without_aliases(top_level(content))
    for section, names in _SECTIONS.items():
        if section in plain:
            # A section with nothing below it is None in YAML.
            plain[section] = mapping(section, plain[section] or {})
            check_names(plain[section], names, f"{section}.")
    # A driver of another package has a section of its own name.
    known = [*_TOP, *ALIASES, MAX_RPM]
    driver = plain.get("driver")
    plug_in = [driver] if isinstance(driver, str) and driver not in [*_BUILT_IN, *known] else []
    # Aliases were replaced above. They are listed so that a misspelt one gets its suggestion.
    check_names(plain, [*known, *plug_in], "")
    for name in plug_in:
        plain["options"] = mapping(name, plain.pop(name, None) or {})
    plain["parameters"] = {
        name: checked_parameter(name, value) for name, value in plain.get("parameters", {}).items()
    }
    for foreign, name in aliases.items():
        log.info("%s is read as %s", foreign, name)
    config = _validated({**plain, "aliases": aliases})
    try:
        serial_link(**asdict(config.serial))
    except InvalidArgument as error:
        raise ConfigurationError(f"serial.{error}") from error
    # Last: what is wrong with a value is told first, whether or not a driver is named.
    if "board" in plain and "pins" in plain:
        raise ConfigurationError("board and pins are both given: remove one of them")
    if "driver" not in plain:
        raise ConfigurationError(f"driver is missing; {_CHOOSE_A_DRIVER}")
    return config


_SECTIONS: dict[str, list[str]] = {
    "pins": [f.name for f in fields(Pins)],
    "pigpio": [f.name for f in fields(PigpioOptions)],
    "serial": [f.name for f in fields(SerialOptions)],
    "gpio": [f.name for f in fields(GpioOptions)],
    "parameters": list(PARAMETER_BY_NAME),
}
_BUILT_IN = ("mock", "l298n", "pigpio", "serial")
_TOP = ["driver", "store", "board", *_SECTIONS]
_CHOOSE_A_DRIVER = "choose one, such as `driver: serial`; there are mock, l298n, pigpio and serial"


def mapping(what: str, value: object) -> dict[str, Any]:
    """`value` as a dictionary; raises `ConfigurationError` if it is none."""
    if not isinstance(value, Mapping):
        raise ConfigurationError(f"{what} = {value!r}: it must be a mapping of names to values")
    return {str(name): entry for name, entry in value.items()}


def _without_aliases(content: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """The content with aliases replaced, and the aliases that were found."""
    plain = {name: value for name, value in content.items() if name not in ALIASES}
    rpm = plain.pop(MAX_RPM, None)
    found = {name: ALIASES[name] for name in content if name in ALIASES}
    for foreign, name in found.items():
        _set_value(plain, name, content[foreign], foreign)
    # After the aliases, one of which may have given the wheel's radius that this needs.
    if rpm is not None:
        found[MAX_RPM] = "parameters.velocity_feedforward"
        _set_value(plain, found[MAX_RPM], _feedforward(rpm, plain), MAX_RPM)
    return plain, found


def _set_value(plain: dict[str, Any], name: str, value: object, foreign: str) -> None:
    section, _, key = name.rpartition(".")
    target = plain
    if section:
        # `mapping` copies: the caller's own content stays as it was.
        target = plain[section] = mapping(section, plain.get(section) or {})
    if key in target:
        raise ConfigurationError(f"{foreign} = {value!r}: {name} is given too; remove one of them")
    target[key] = value


def _feedforward(rpm: object, plain: dict[str, Any]) -> float:
    """Duty per m/s: full duty less what static friction takes, divided by the no-load speed."""
    # Not `rpm <= 0`, which would let NaN pass.
    if not isinstance(rpm, (int, float)) or not rpm > 0:
        raise ConfigurationError(f"{MAX_RPM} = {rpm!r}: it must be a number above 0")
    default = PARAMETER_BY_NAME["wheel_radius"].default
    parameters = mapping("parameters", plain.get("parameters") or {})
    radius = parameters.get("wheel_radius", default)
    # v0 = w0 r, from "The four equations" in docs/drivers.md.
    no_load_mps = rpm * 2 * math.pi / 60 * checked_parameter("wheel_radius", radius)
    default = PARAMETER_BY_NAME["static_feedforward"].default
    static = checked_parameter("static_feedforward", parameters.get("static_feedforward", default))
    return (1 - static) / no_load_mps


def check_names(given: Mapping[str, Any], known: list[str], prefix: str) -> None:
    """Refuse unknown keys by `ConfigurationError`, with a similar one. `prefix`: the section."""
    for name in given:
        if name not in known:
            raise ConfigurationError(
                f"{prefix}{name} = {given[name]!r}: unknown key; {_suggestion(name, known, prefix)}"
            )


def _suggestion(name: str, known: list[str], prefix: str) -> str:
    """A key that may be meant: one of the same name in a section, else a similar one here."""
    # Often the key is right and only its section is missing.
    places = [f"{section}.{name}" for section, names in _SECTIONS.items() if name in names]
    near = [prefix + match for match in get_close_matches(name, known, n=1, cutoff=0.5)]
    if meant := " or ".join(places or near):
        return f"did you mean {meant}?"
    return f"the keys are {', '.join(known)}"


def _is_of_ros(content: object) -> bool:
    """Whether it is a file for `ros2 run ... --params-file`."""
    return isinstance(content, Mapping) and any(
        isinstance(node, Mapping) and "ros__parameters" in node for node in content.values()
    )


def checked_parameter(name: str, value: object) -> float:
    """A firmware parameter's value from a file; raises `ConfigurationError` with its bound."""
    # A bool is an int, too: `true` and `false` are how people write a switch.
    if not isinstance(value, (int, float)):
        raise ConfigurationError(f"parameters.{name} = {value!r}: it must be a number")
    try:
        return checked_value(name, value)
    except ParameterOutOfRange as error:
        raise ConfigurationError(
            f"parameters.{name} = {value!r}: it must be {error.bound}"
        ) from error


def _validated(content: dict[str, Any]) -> RobotConfig:
    try:
        # Here: it comes with an extra, and the rest of this module does without it.
        from pydantic import TypeAdapter, ValidationError
    except ImportError as error:
        raise _not_installed(error) from error
    try:
        # Names and parameters were checked before: pydantic checks the types of the rest.
        return TypeAdapter(RobotConfig).validate_python(content)
    except ValidationError as error:
        # The first alone: the message of an error is one line.
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        expected = next((text for kind, text in _TYPES if first["type"].startswith(kind)), "")
        rule = f"it must be {expected}" if expected else first["msg"]
        raise ConfigurationError(f"{key} = {shown(first['input'])}: {rule}") from error


_TYPES = (
    ("int", "a whole number"),
    ("float", "a number"),
    ("bool", "true or false"),
    ("string", "a text; put one that looks like a number in quotes"),
    ("dataclass", "a mapping of names to values"),
    ("dict", "a mapping of names to values"),
)
"""What pydantic calls an error begins with, and what is expected then."""


def _not_installed(error: ImportError) -> DriverUnavailable:
    return DriverUnavailable(
        f"reading a robot's file needs {error.name}: run pip install 'wheelwire[tools]'"
    )
