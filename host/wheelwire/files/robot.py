"""A robot's file: driver, pins, options and parameters, also under the names of other packages."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from wheelwire_protocol.native import NativeMissingError
from wheelwire_protocol.parameters import PARAMETER_BY_NAME

from ..arguments import is_number
from ..board import Configuration
from ..errors import ConfigurationError, shown
from .parameters import parameter_value, parameter_values
from .peripherals import SECTIONS, parse_peripherals
from .pins import PIN_NAMES, Pins, check_hardware_pwm
from .reading import Section

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


def parse_robot(content: object, shapes: Mapping[str, type]) -> dict[str, Any]:
    """The values of a file by name; each section in `shapes` becomes the dataclass given there.

    `options` is the section of a driver that is not in `shapes`. `aliases` maps the names of other
    packages in the file to the names that they stand for.

    Raises:
        ConfigurationError: The message begins with the key, and has its value and what is allowed.
    """
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
    """Replace aliases by the names that they stand for; returns the aliases found, with names."""
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
