"""The sections of a board's file that name its peripherals: `imu`, `power`, `inputs`, `ranges`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import MISSING
from typing import Any

from wheelwire_protocol import codes, peripherals
from wheelwire_protocol.codes import PeripheralKind, Place

from ...arguments import is_number
from ...board import (
    AnalogInput,
    BatteryLevels,
    DigitalInput,
    ImuSensor,
    Peripheral,
    PowerSensor,
    Pull,
    RangeSensor,
    axis_name,
    key_of,
    most_bias_radps,
)
from .reading import Section

SECTIONS = ("imu", "power", "inputs", "ranges")

_CHIP_NAMES = {chip: chip.name.lower().replace("_", "-") for chip in peripherals.SensorChip}
_IMU_CHIPS = {_CHIP_NAMES[chip]: chip for chip in peripherals.IMUS}
_POWER_CHIPS = {_CHIP_NAMES[chip]: chip for chip in peripherals.POWERS}
_RANGE_CHIPS = {_CHIP_NAMES[chip]: chip for chip in peripherals.RANGES}
_AXES = {axis_name(axis): axis for axis in peripherals.Axis}
_PULLS = {pull.value: pull for pull in Pull}
_LEVELS = {"low": True, "high": False}
# The defaults. A bumper is a normally closed switch to ground.
_TRIGGERED = {
    PeripheralKind.BUMPER: "high",
    PeripheralKind.CLIFF: "high",
    PeripheralKind.STAGE_FAULT: "low",
}
_NOT_OF_BUMPERS = (Place.NONE, Place.LEFT, Place.RIGHT)
_INPUTS = {
    codes.channel_name(kind, place).replace(".", "_"): (kind, place)
    for kind in codes.DIGITAL_INPUTS
    for place in Place
    if kind is not PeripheralKind.BUMPER or place not in _NOT_OF_BUMPERS
}
_ANALOG = {
    codes.channel_name(PeripheralKind.ANALOG, Place.NONE, number): number
    for number in range(1, peripherals.MOST_ANALOG + 1)
}
_PLACES = {place.name.lower(): place for place in Place if place is not Place.NONE}
_SHUNTS_MOHM = 0.1, peripherals.MAX_SHUNT_UOHM / 1000
_MAX_V = 65.0
"""A level travels as millivolts in 16 bits."""
_DIVIDERS = 1.0, 20.0
_MAX_ADDRESS = 0x77
_MAX_CELLS = 15
_LAST_BUS = 127
"""A bus's number travels as a signed byte."""
_CELL_V = {"warn_v": 3.5, "limit_v": 3.4, "stop_v": 3.3}
"""Levels of one lithium-ion cell, for a file that gives only the number of cells."""


def parse_peripherals(board: Section) -> tuple[Peripheral, ...]:
    """The peripherals in a board's file, in the order of their channels.

    Raises:
        ConfigurationError: A key is unknown or missing, or a value is not of its kind.
    """
    parsers = {"imu": _imu, "power": _power, "inputs": _inputs, "ranges": _ranges}
    entries: list[Peripheral] = []
    for section, parse in parsers.items():
        if board.get(section, None) is not None:
            entries += parse(board)
    return tuple(entries)


def peripheral_sections(peripherals: Sequence[Peripheral]) -> dict[str, Any]:
    """The sections of a board's file; `parse_peripherals` makes the same peripherals of them."""
    sections: dict[str, dict[str, Any]] = {}
    # A section begins with its chip, whatever its channels; inputs keep their order.
    for entry in sorted(peripherals, key=lambda entry: min(entry.kind, PeripheralKind.BUMPER)):
        section, _, name = key_of(entry).partition(".")
        content = sections.setdefault(section, {})
        if name:
            content[name] = without_none(_content(entry))
        # Without a power sensor, an empty section means a battery without levels.
        elif content or not isinstance(entry, BatteryLevels) or entry.is_guarded:
            content |= without_none(_content(entry))
    return {name: sections[name] for name in SECTIONS if name in sections}


def _content(entry: Peripheral) -> dict[str, Any]:
    if isinstance(entry, DigitalInput):
        level = "low" if entry.triggered_low else "high"
        return {"pin": entry.pin, "triggered": level, "pull": entry.pull.value}
    if isinstance(entry, AnalogInput):
        return {"pin": entry.pin, "divider": entry.divider}
    if isinstance(entry, RangeSensor):
        return {"chip": _CHIP_NAMES[entry.chip], "trigger": entry.trigger, "echo": entry.echo}
    if isinstance(entry, BatteryLevels):
        return {name: getattr(entry, name) for name in _CELL_V}
    chip = _CHIP_NAMES[entry.chip]
    bus = {"chip": chip, "sda": entry.sda, "scl": entry.scl, "bus": entry.bus}
    if isinstance(entry, PowerSensor):
        return {**bus, "shunt_mohm": entry.shunt_mohm, "address": entry.address}
    axes = {name: axis_name(getattr(entry, name)) for name in ("forward", "up")}
    bias = list(entry.bias) if any(entry.bias) else None
    return {**bus, "interrupt": entry.interrupt, **axes, "address": entry.address, "bias": bias}


def _imu(board: Section) -> Iterator[ImuSensor]:
    keys = ("chip", "sda", "scl", "bus", "interrupt", "forward", "up", "address", "bias")
    imu = Section(board.get("imu"), keys, "imu")
    if imu.pin("interrupt") is not None and _bus(imu) is not None:
        raise imu.refusal("interrupt", "leave it out: a computer stamps samples when it reads them")
    chip = imu.code("chip", _IMU_CHIPS)
    yield ImuSensor(
        chip=chip,
        sda=imu.pin("sda"),
        scl=imu.pin("scl"),
        interrupt=imu.pin("interrupt"),
        forward=imu.code("forward", _AXES),
        up=imu.code("up", _AXES),
        address=_address(imu),
        bias=_bias(imu, chip),
        bus=_bus(imu),
    )


def _power(board: Section) -> Iterator[PowerSensor | BatteryLevels]:
    bus = ("chip", "sda", "scl", "bus", "shunt_mohm", "address")
    levels = ("cells", *_CELL_V)
    power = Section(board.get("power"), (*bus, *levels), "power")
    has_chip, has_levels = (any(key in power.values for key in keys) for keys in (bus, levels))
    if has_chip:
        yield PowerSensor(
            chip=power.code("chip", _POWER_CHIPS),
            sda=power.pin("sda"),
            scl=power.pin("scl"),
            shunt_mohm=_within(power, "shunt_mohm", _SHUNTS_MOHM),
            address=_address(power),
            bus=_bus(power),
        )
    if has_levels:
        yield _levels(power)
    elif not has_chip:
        yield BatteryLevels()  # the board's divider measures it


def _levels(power: Section) -> BatteryLevels:
    defaults: dict[str, float] = {}
    if "cells" in power.values:
        cells = power.whole("cells", _MAX_CELLS, low=1)
        defaults = {name: round(cells * volts, 3) for name, volts in _CELL_V.items()}
    volts = (0.0, _MAX_V)
    return BatteryLevels(
        **{name: _within(power, name, volts, defaults.get(name, MISSING)) for name in _CELL_V}
    )


def _bias(imu: Section, chip: peripherals.SensorChip) -> tuple[float, float, float]:
    value, most = imu.get("bias", None), most_bias_radps(chip)
    if value is None:
        return (0.0, 0.0, 0.0)
    is_list = isinstance(value, list) and len(value) == len("xyz")
    if not is_list or not all(is_number(each) and abs(each) <= most for each in value):
        raise imu.refusal(
            "bias", f"it must be three numbers [x, y, z], each {-most:.2f} to {most:.2f} rad/s"
        )
    x, y, z = map(float, value)
    return (x, y, z)


def _inputs(board: Section) -> Iterator[DigitalInput | AnalogInput]:
    inputs = Section(board.get("inputs"), (*_INPUTS, *_ANALOG), "inputs")
    for name in inputs.values:
        if name in _ANALOG:
            entry = Section(inputs.get(name), ("pin", "divider"), f"inputs.{name}")
            divider = _within(entry, "divider", _DIVIDERS, 1.0)
            yield AnalogInput(_ANALOG[name], entry.pin("pin"), divider)
            continue
        kind, place = _INPUTS[name]
        entry = Section(inputs.get(name), ("pin", "triggered", "pull"), f"inputs.{name}")
        is_low = entry.code("triggered", _LEVELS, _TRIGGERED[kind])
        if kind is PeripheralKind.STAGE_FAULT and not is_low:
            raise entry.refusal(
                "triggered", "a power stage's fault output is low when it has tripped: leave it out"
            )
        pull = entry.code("pull", _PULLS, Pull.INTERNAL.value)
        yield DigitalInput(kind, place, entry.pin("pin"), is_low, pull)


def _ranges(board: Section) -> Iterator[RangeSensor]:
    ranges = Section(board.get("ranges"), _PLACES, "ranges")
    for name in ranges.values:
        entry = Section(ranges.get(name), ("chip", "trigger", "echo"), f"ranges.{name}")
        chip = entry.code("chip", _RANGE_CHIPS)
        yield RangeSensor(chip, _PLACES[name], entry.pin("trigger"), entry.pin("echo"))


def _within(
    section: Section, name: str, bounds: tuple[float, float], default: object = MISSING
) -> float:
    value, (low, high) = section.get(name, default), bounds
    if not is_number(value) or not low <= value <= high:
        raise section.refusal(name, f"it must be a number, {low:g} to {high:g}")
    return float(value)


def _address(section: Section) -> int | None:
    if section.get("address", None) is None:
        return None
    address = section.whole("address", _MAX_ADDRESS)
    if address == 0:
        raise section.refusal("address", "leave it out for the chip's usual address")
    return address


def _bus(section: Section) -> int | None:
    """The number of a computer's bus."""
    if section.get("bus", None) is None:
        for pin, other in (("sda", "scl"), ("scl", "sda")):
            if section.pin(pin) is not None and section.pin(other) is None:
                raise section.refusal(
                    pin, f"name {other}, too; on a computer, name the bus's number in place of both"
                )
        return None
    for pin in ("sda", "scl"):
        if section.get(pin, None) is not None:
            raise section.refusal("bus", "a bus has either a number or pins: leave sda and scl out")
    return section.whole("bus", _LAST_BUS)


def without_none(content: dict[str, Any]) -> dict[str, Any]:
    """The content of a section without what it leaves out."""
    return {name: value for name, value in content.items() if value is not None}
