"""The sections of a board's file that name its peripherals: `imu`, `power` and `inputs`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING
from typing import Any

from wheelwire_protocol.sensors import (
    IMUS,
    MAX_SHUNT_UOHM,
    POWERS,
    Axis,
    PeripheralKind,
    Place,
    SensorChip,
)

from ..arguments import is_number
from ..peripherals import (
    DIGITAL_INPUTS,
    BatteryLevels,
    DigitalInput,
    ImuSensor,
    Peripheral,
    PowerSensor,
    Pull,
    channel_name,
)
from .reading import Section

SECTIONS = ("imu", "power", "inputs")

_CHIP_NAMES = {chip: chip.name.lower().replace("_", "-") for chip in SensorChip}
_IMU_CHIPS = {_CHIP_NAMES[chip]: chip for chip in IMUS}
_POWER_CHIPS = {_CHIP_NAMES[chip]: chip for chip in POWERS}
_AXES = {axis.name.lower().replace("minus_", "-"): axis for axis in Axis}
_PULLS = {pull.value: pull for pull in Pull}
_LEVELS = {"low": True, "high": False}
# Unless the file says otherwise. A bumper is a normally closed switch to ground.
_TRIGGERED = {
    PeripheralKind.BUMPER: "high",
    PeripheralKind.CLIFF: "high",
    PeripheralKind.STAGE_FAULT: "low",
}
_INPUTS = {
    channel_name(kind, place).replace(".", "_"): (kind, place)
    for kind in DIGITAL_INPUTS
    for place in Place
}
_MAX_SHUNT_MOHM = MAX_SHUNT_UOHM / 1000
_MAX_V = 65.0
"""A level travels as millivolts in 16 bits."""
_MAX_ADDRESS = 0x7F
_MAX_CELLS = 15
_CELL_V = {"warn_v": 3.5, "limit_v": 3.4, "stop_v": 3.3}
"""Of one cell of lithium ions, for a file that gives only their number."""


def parse_peripherals(board: Section) -> tuple[Peripheral, ...]:
    """The peripherals in a board's file, in the order of their channels.

    Raises:
        ConfigurationError: A key is unknown or missing, or a value is not of its kind.
    """
    return (*_imu(board), *_power(board), *_inputs(board))


def peripheral_sections(peripherals: Sequence[Peripheral]) -> dict[str, Any]:
    """The sections of a board's file; `parse_peripherals` makes the same peripherals of them."""
    sections: dict[str, dict[str, Any]] = {}
    # The chip of a section first, whatever the channels; inputs stay in their order.
    for entry in sorted(peripherals, key=lambda entry: min(entry.kind, PeripheralKind.BUMPER)):
        if isinstance(entry, DigitalInput):
            name = channel_name(entry.kind, entry.place).replace(".", "_")
            level = "low" if entry.triggered_low else "high"
            content = {"pin": entry.pin, "triggered": level, "pull": entry.pull.value}
            sections.setdefault("inputs", {})[name] = _without_none(content)
        elif isinstance(entry, BatteryLevels):
            power = sections.setdefault("power", {})
            if entry.is_guarded or power:
                power |= {name: getattr(entry, name) for name in _CELL_V}
        elif isinstance(entry, PowerSensor):
            bus = _bus_of(entry) | {"shunt_mohm": entry.shunt_mohm, "address": entry.address}
            sections["power"] = _without_none(bus)
        else:
            axes = {name: _name_of(getattr(entry, name)) for name in ("forward", "up")}
            other = {"interrupt": entry.interrupt, **axes, "address": entry.address}
            sections["imu"] = _without_none(_bus_of(entry) | other)
    return {name: sections[name] for name in SECTIONS if name in sections}


def _imu(board: Section) -> Iterator[ImuSensor]:
    if board.get("imu", None) is None:
        return
    keys = ("chip", "sda", "scl", "interrupt", "forward", "up", "address")
    imu = Section(board.get("imu"), keys, "imu")
    yield ImuSensor(
        chip=imu.code("chip", _IMU_CHIPS),
        sda=imu.pin("sda"),
        scl=imu.pin("scl"),
        interrupt=imu.pin("interrupt"),
        forward=imu.code("forward", _AXES),
        up=imu.code("up", _AXES),
        address=_address(imu),
    )


def _power(board: Section) -> Iterator[PowerSensor | BatteryLevels]:
    if board.get("power", None) is None:
        return
    bus, levels = ("chip", "sda", "scl", "shunt_mohm", "address"), ("cells", *_CELL_V)
    power = Section(board.get("power"), (*bus, *levels), "power")
    has_chip, has_levels = (any(key in power.values for key in keys) for keys in (bus, levels))
    if has_chip:
        yield PowerSensor(
            chip=power.code("chip", _POWER_CHIPS),
            sda=power.pin("sda"),
            scl=power.pin("scl"),
            shunt_mohm=_shunt_mohm(power),
            address=_address(power),
        )
    if has_levels:
        yield _levels(power)
    elif not has_chip:
        yield BatteryLevels()  # the board's divider measures it


def _levels(power: Section) -> BatteryLevels:
    defaults: dict[str, float] = {}
    if "cells" in power.values:
        cells = power.whole("cells", _MAX_CELLS)
        if cells == 0:
            raise power.refusal("cells", f"it must be a whole number, 1 to {_MAX_CELLS}")
        defaults = {name: round(cells * volts, 3) for name, volts in _CELL_V.items()}
    return BatteryLevels(**{name: _level(power, name, defaults) for name in _CELL_V})


def _inputs(board: Section) -> Iterator[DigitalInput]:
    if board.get("inputs", None) is None:
        return
    inputs = Section(board.get("inputs"), _INPUTS, "inputs")
    for name in inputs.values:
        kind, place = _INPUTS[name]
        entry = Section(inputs.get(name), ("pin", "triggered", "pull"), f"inputs.{name}")
        is_low = entry.code("triggered", _LEVELS, _TRIGGERED[kind])
        if kind is PeripheralKind.STAGE_FAULT and not is_low:
            raise entry.refusal(
                "triggered", "a power stage's fault output is low when it has tripped: leave it out"
            )
        pull = entry.code("pull", _PULLS, Pull.INTERNAL.value)
        yield DigitalInput(kind, place, entry.pin("pin"), is_low, pull)


def _level(power: Section, name: str, defaults: Mapping[str, float]) -> float:
    value = power.get(name, defaults.get(name, MISSING))
    if not is_number(value) or not 0 <= value <= _MAX_V:
        raise power.refusal(name, f"it must be a number, 0 to {_MAX_V:g}")
    return float(value)


def _shunt_mohm(power: Section) -> float:
    value = power.above_zero("shunt_mohm")
    if value > _MAX_SHUNT_MOHM:
        raise power.refusal("shunt_mohm", f"it must be {_MAX_SHUNT_MOHM:g} at most")
    return value


def _address(section: Section) -> int | None:
    if section.get("address", None) is None:
        return None
    address = section.whole("address", _MAX_ADDRESS)
    if address == 0:
        raise section.refusal("address", "leave it out for the chip's usual one")
    return address


def _bus_of(entry: ImuSensor | PowerSensor) -> dict[str, Any]:
    return {"chip": _CHIP_NAMES[entry.chip], "sda": entry.sda, "scl": entry.scl}


def _name_of(axis: Axis) -> str:
    return next(name for name, value in _AXES.items() if value is axis)


def _without_none(content: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in content.items() if value is not None}
