"""A robot in one YAML file: which driver, which pins, which numbers.

The numbers are the firmware's parameters, with its bounds. Names that others use for them are taken
too, and reported.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from difflib import get_close_matches
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from .drivers.factory import open_driver
from .errors import ConfigurationError, DriverUnavailable, ParameterOutOfRange, shown
from .link.transports import UNIX
from .linux_mcu.pins import Pins
from .linux_mcu.settings import McuSettings
from .linux_mcu.store import converted_store
from .parameters import checked_value

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
"""Top-level names of other files, and what they are called here."""
MAX_RPM = "max_rpm"
"""The motor's no-load speed; with the wheel's radius it is the velocity feed-forward."""


@dataclass(frozen=True)
class PigpioOptions:
    """Where pigpiod runs."""

    host: str = "localhost"
    port: int = 8888


@dataclass(frozen=True)
class SerialOptions:
    """Where the ESP32 is."""

    port: str = "/dev/ttyUSB0"
    baud_rate: int = 921_600


@dataclass(frozen=True)
class GpioOptions:
    """This computer's own pins."""

    pwm_chip: int | None = None


@dataclass(frozen=True)
class RobotConfig:
    """One robot. `parameters` has those that were given, under the firmware's names.

    Attributes:
        store: File in which the robot's process keeps saved parameters; not of a serial robot,
            whose device keeps its own.
        aliases: The foreign names that were found, and what they stand for.
    """

    driver: str = "pigpio"
    pins: Pins = field(default_factory=Pins)
    pigpio: PigpioOptions = field(default_factory=PigpioOptions)
    serial: SerialOptions = field(default_factory=SerialOptions)
    gpio: GpioOptions = field(default_factory=GpioOptions)
    store: str | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    aliases: dict[str, str] = field(default_factory=dict)

    def driver_options(self) -> dict[str, Any]:
        """The arguments of this robot's driver."""
        store = None if self.store is None else Path(self.store)
        local = {"pins": self.pins, "parameters": self.parameters, "store": store}
        return {
            "mock": {"parameters": self.parameters, "store": store},
            "pigpio": {**asdict(self.pigpio), **local},
            "l298n": {**asdict(self.gpio), **local},
            "serial": {**asdict(self.serial), "parameters": self.parameters},
        }.get(self.driver, {})


def open_robot(file: str | Path | None = None) -> BaseDriver:
    """Open the robot that a YAML file describes; the shipped `pi4b_params.yaml` without one.

    A serial robot is given the file's parameters whenever a session opens, whatever it has saved.
    The others start with them; what was saved in `store` comes first.

    Raises:
        ConfigurationError: The file is not there, or says what cannot be.
        WheelwireError: As `open_driver`.
    """
    config = load_config(file)
    return open_driver(config.driver, **config.driver_options())


def service_settings(config: RobotConfig, address: str) -> McuSettings:
    """Of the process that serves this robot at `address`, `unix:path`.

    Raises:
        ConfigurationError: The robot's pins are not this computer's, or the address is of another
            kind.
        DriverUnavailable: The core's library is missing.
    """
    path = address.removeprefix(UNIX)
    if path == address or not path:
        raise ConfigurationError(f"listen = {address!r}: it must be unix:PATH")
    if config.driver not in ("l298n", "pigpio"):
        raise ConfigurationError(f"driver = {config.driver!r}: it must be l298n or pigpio")
    return McuSettings(
        backend="pigpio" if config.driver == "pigpio" else "l298n",
        pins=config.pins,
        parameters=config.parameters,
        store=None if config.store is None else str(converted_store(Path(config.store))),
        pwm_chip=config.gpio.pwm_chip,
        host=config.pigpio.host,
        port=config.pigpio.port,
        listen=str(Path(path).absolute()),
    )


def load_config(file: str | Path | None = None) -> RobotConfig:
    """Read and check a YAML file; the shipped `pi4b_params.yaml` without one.

    Raises:
        ConfigurationError: With the key, the value, and what it must be.
        DriverUnavailable: pydantic is not installed.
    """
    if file is not None and not isinstance(file, (str, Path)):
        raise ConfigurationError(f"{shown(file)} is no file: give a path")
    source = Path(str(files(__package__) / DEFAULT_FILE)) if file is None else Path(file)
    try:
        content = yaml.load(source.read_text(), _UniqueKeys)  # noqa: S506 - it is a SafeLoader
    except FileNotFoundError as error:
        raise ConfigurationError(f"{source}: there is no such file") from error
    except OSError as error:
        raise ConfigurationError(f"{source}: {error.strerror}") from error
    except (ValueError, yaml.YAMLError) as error:
        raise ConfigurationError(f"{source}: {' '.join(str(error).split())}") from error
    try:
        return parse_config(content)
    except ConfigurationError as error:
        raise ConfigurationError(f"{source}: {error}") from error


def parse_config(content: object) -> RobotConfig:
    """Check what a file says; as `load_config`."""
    if content is None:
        raise ConfigurationError(f"it is empty; {_NAME_A_DRIVER}")
    if _is_of_ros(content):
        raise ConfigurationError(
            "it is a parameter file of ROS: start the node with it "
            "(params_file:=...); a robot's own file has `driver:`, not `ros__parameters:`"
        )
    plain, aliases = _without_aliases(_mapping("the file", content))
    for section, names in _SECTIONS.items():
        if section in plain:
            plain[section] = _mapping(section, plain[section] or {})
            _check_names(plain[section], names, f"{section}.")
    _check_names(plain, [*_TOP, *ALIASES, MAX_RPM], "")
    plain["parameters"] = {
        name: _checked_parameter(name, value) for name, value in plain.get("parameters", {}).items()
    }
    for foreign, name in aliases.items():
        log.info("%s is taken for %s", foreign, name)
    config = _validated({**plain, "aliases": aliases})
    if "driver" not in plain:
        raise ConfigurationError(f"driver is missing; {_NAME_A_DRIVER}")
    return config


class _UniqueKeys(yaml.SafeLoader):
    """YAML asks for unique keys; PyYAML takes the last of several without a word."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Raises ConstructorError, a YAMLError, when a key is there twice."""
        mapping = super().construct_mapping(node, deep=deep)
        seen: set[str] = set()
        for key, _ in node.value:
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"{key.value} is given twice; keep one of them",
                    problem_mark=key.start_mark,
                )
            seen.add(key.value)
        return mapping


_SECTIONS: dict[str, list[str]] = {
    "pins": [f.name for f in fields(Pins)],
    "pigpio": [f.name for f in fields(PigpioOptions)],
    "serial": [f.name for f in fields(SerialOptions)],
    "gpio": [f.name for f in fields(GpioOptions)],
    "parameters": list(PARAMETER_BY_NAME),
}
_TOP = ["driver", "store", *_SECTIONS]
_NAME_A_DRIVER = "say which, such as `driver: serial`; there are mock, l298n, pigpio and serial"


def _mapping(what: str, value: object) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ConfigurationError(f"{what} = {value!r}: it must be a mapping of names to values")
    return {str(name): entry for name, entry in value.items()}


def _without_aliases(content: dict[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """The content under our names, and the foreign names that were in it."""
    plain = {name: value for name, value in content.items() if name not in ALIASES}
    rpm = plain.pop(MAX_RPM, None)
    found = {name: ALIASES[name] for name in content if name in ALIASES}
    for foreign, name in found.items():
        _place(plain, name, content[foreign], foreign)
    if rpm is not None:
        found[MAX_RPM] = "parameters.velocity_feedforward"
        _place(plain, found[MAX_RPM], _feedforward(rpm, plain), MAX_RPM)
    return plain, found


def _place(plain: dict[str, Any], name: str, value: object, foreign: str) -> None:
    section, _, key = name.rpartition(".")
    target = plain
    if section:
        target = plain[section] = _mapping(section, plain.get(section) or {})
    if key in target:
        raise ConfigurationError(f"{foreign} = {value!r}: {name} is given too; give one of them")
    target[key] = value


def _feedforward(rpm: object, plain: dict[str, Any]) -> float:
    """Duty per m/s: what friction leaves of the duty, over the rim's speed at full duty."""
    if not isinstance(rpm, (int, float)) or not rpm > 0:
        raise ConfigurationError(f"{MAX_RPM} = {rpm!r}: it must be a number above 0")
    default = PARAMETER_BY_NAME["wheel_radius"].default
    radius = plain.get("parameters", {}).get("wheel_radius", default)
    no_load_mps = rpm * 2 * math.pi / 60 * _checked_parameter("wheel_radius", radius)
    return (1 - PARAMETER_BY_NAME["static_feedforward"].default) / no_load_mps


def _check_names(given: Mapping[str, Any], known: list[str], prefix: str) -> None:
    for name in given:
        if name not in known:
            raise ConfigurationError(
                f"{prefix}{name} = {given[name]!r}: no such key; {_instead(name, known, prefix)}"
            )


def _instead(name: str, known: list[str], prefix: str) -> str:
    """Which key was meant: one in a section by the same name, else a similar one here."""
    places = [f"{section}.{name}" for section, names in _SECTIONS.items() if name in names]
    near = [prefix + match for match in get_close_matches(name, known, n=1, cutoff=0.5)]
    if meant := " or ".join(places or near):
        return f"did you mean {meant}?"
    return f"there are {', '.join(known)}"


def _is_of_ros(content: object) -> bool:
    """Whether it has the form that `ros2 run ... --params-file` takes."""
    return isinstance(content, Mapping) and any(
        isinstance(node, Mapping) and "ros__parameters" in node for node in content.values()
    )


def _checked_parameter(name: str, value: object) -> float:
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
        from pydantic import TypeAdapter, ValidationError
    except ImportError as error:
        raise _not_installed(error) from error
    try:
        return TypeAdapter(RobotConfig).validate_python(content)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        raise ConfigurationError(f"{key} = {first['input']!r}: {first['msg']}") from error


def _not_installed(error: ImportError) -> DriverUnavailable:
    return DriverUnavailable(
        f"reading a robot's file needs {error.name}: pip install 'wheelwire[tools]'"
    )
