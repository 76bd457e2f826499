"""MESSAGES.md: every message, code and parameter, for people."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Iterator
from itertools import chain, groupby
from typing import NamedTuple

from ..board import CODES as BOARD_CODES
from ..board import BoardFault, BoardPin
from ..board_layout import Board, Peripheral
from ..codes import (
    ENUMERATIONS,
    FLAGS,
    RECORDER_CODES,
    BatteryLevel,
    BoxCause,
    Chip,
    ConfigurationState,
    DocumentedEnum,
    DocumentedFlag,
    Failure,
    Group,
    Held,
    Place,
    ResetReason,
    SensorEventCode,
    SupervisorEvent,
    SupervisorState,
    TrialAction,
    Unit,
)
from ..message import CRC_SIZE, HEADER_SIZE, Field, Message, fields_of
from ..messages import MESSAGES, PROTOCOL_VERSION, Request, Sample, Setpoint
from ..parameters import PARAMETERS, PLATFORM_DEFAULTS, Changes, Kind, Parameter
from ..peripherals import CODES as SENSOR_CODES
from ..peripherals import FLAGS as SENSOR_FLAGS
from ..peripherals import Axis, PeripheralFault, SensorChip
from ..power_stages import Stage
from ..self_test import MESSAGES as SELF_TEST_MESSAGES
from .text import banner, lines, unit_note
from .wire_layout import layout_hash, self_test_hash

FRAMING_SIZE = 3
"""Bytes a frame has beyond its payload: one COBS code, two delimiters."""

_CODES: tuple[type[DocumentedEnum] | type[DocumentedFlag], ...] = (
    *ENUMERATIONS,
    *BOARD_CODES,
    *RECORDER_CODES,
    *SENSOR_CODES,
    *FLAGS,
    *SENSOR_FLAGS,
)
_NAMES_SAY_IT = (
    SupervisorState,
    SupervisorEvent,
    Group,
    TrialAction,
    ResetReason,
    Chip,
    ConfigurationState,
    BoardPin,
    BoardFault,
    BoxCause,
    SensorChip,
    Place,
    Axis,
    BatteryLevel,
    PeripheralFault,
    Held,
)
"""Codes whose names, or SPEC.md, say what they mean."""
_UNITS_IN_WORDS = (Unit.RADIAN_PER_SECOND, Unit.METRE_PER_SECOND_SQUARED)
"""All others are in the name of every field that has them."""
_IN_FULL = (Stage, SensorEventCode)
"""A member's doc says after its first clause what the code means, not what follows from it."""

_INTRODUCTION = """\
Every message, code and parameter of protocol version {version}. [SPEC.md](SPEC.md) explains how
they work together.

Numbers are little-endian and packed: `u16` is unsigned, `i16` signed, `f32` an IEEE 754 binary32;
`char[n]` has n bytes, filled up with zeros. The last part of a name is its unit; `_q15` is a value
x 32767, `_cdeg` hundredths of a degree Celsius. Several names before one type are as many fields. A
frame is {overhead} bytes longer than its body."""


class _Part(NamedTuple):
    """Fields that several messages have in common."""

    name: str
    fields: tuple[Field, ...]


_PARTS = (
    _Part("request", fields_of(Request)),
    _Part("setpoint", fields_of(Setpoint)),
    _Part("sample", fields_of(Sample)),
    _Part("board", fields_of(Board)),
    _Part("peripheral", fields_of(Peripheral)),
)


def wire_type(field: Field) -> str:
    """`u16`, `i32`, `f32`: the type of a field on the wire."""
    if field.is_text:
        return f"char[{field.subcon.length}]"
    kind = "f" if field.format == "f" else "u" if field.format.isupper() else "i"
    return f"{kind}{8 * struct.calcsize('<' + field.format)}"


def _note(field: Field) -> str:
    """What name and type of a field do not say: its unit and doc."""
    unit = unit_note(field.unit).strip() if field.unit in _UNITS_IN_WORDS else ""
    return f"{unit} {field.docs}".strip()


def _columns(item: _Part | Field) -> tuple[str, str]:
    if isinstance(item, _Part):
        return (f"*{item.name}*", "")
    codes = item.enumeration.__name__ if item.enumeration else ""
    link = f" [{codes}](#{codes.lower()})" if codes else ""
    return (f"{wire_type(item)}{link}", _note(item))


def _fields(items: Iterable[_Part | Field]) -> Iterator[str]:
    """One line for each field, or for consecutive ones that are alike or need no words."""
    plain: list[str] = []
    for (kind, note), alike in groupby(items, key=_columns):
        names = ", ".join(f"`{one.name}`" for one in alike if isinstance(one, Field))
        text = f"{names} {kind}".strip()
        if not note:
            plain.append(text)
            continue
        if plain:
            yield f"- {'; '.join(plain)}"
            plain = []
        yield f"- {text}: {note}"
    if plain:
        yield f"- {'; '.join(plain)}"


def _parted(fields: tuple[Field, ...]) -> Iterator[_Part | Field]:
    """The fields of a message; the fields of a part appear as the part."""

    def layout(fields: Iterable[Field]) -> list[tuple[str, ...]]:
        return [(field.name, *_columns(field)) for field in fields]

    while fields:
        for part in _PARTS:
            if layout(fields[: len(part.fields)]) == layout(part.fields):
                yield part
                fields = fields[len(part.fields) :]
                break
        else:
            yield fields[0]
            fields = fields[1:]


def _message(message: Message) -> list[str]:
    items = list(_parted(message.fields))
    begins = f", *{items.pop(0).name}*" if isinstance(items[0], _Part) else ""
    size = f"{message.body_size} bytes"
    head = f"**{message.name}** `0x{message.id:02x}`, {size}{begins}. {message.doc}"
    return [head, "", *_fields(items), *([""] if items else [])]


def _messages(messages: Iterable[Message]) -> str:
    return lines(chain.from_iterable(map(_message, messages)))


def _parts() -> Iterator[str]:
    for part in _PARTS:
        yield from (f"*{part.name}*", "", *_fields(part.fields), "")


def _clause(doc: str) -> str:
    """The first clause of a code's doc."""
    return re.split("[;:.] ", doc)[0].rstrip(".")


def _codes(codes: type[DocumentedEnum] | type[DocumentedFlag]) -> list[str]:
    what = (codes.__doc__ or "").strip()
    bits = " Bits." if issubclass(codes, DocumentedFlag) else ""
    head = [f"### {codes.__name__}", "", what + bits]
    if codes in _NAMES_SAY_IT:
        return [*head, "", ", ".join(f"{m.value:d} `{m.name}`" for m in codes) + ".", ""]
    whole = codes in _IN_FULL
    rows = (f"- {m.value:d} `{m.name}`: {m.doc if whole else _clause(m.doc)}" for m in codes)
    return [*head, "", *rows, ""]


def _parameter_line(parameter: Parameter) -> str:
    bounds = f"{parameter.minimum:.9g}..{parameter.maximum:.9g}"
    if parameter.kind is Kind.SWITCH:
        bounds = "0, 1"
    if parameter.kind is Kind.WHOLE:
        bounds += ", whole"
    unit = parameter.unit.value.partition(" (")[0]  # without the range of a duty
    default = f"{parameter.default:.9g} {unit}".strip()
    changes = "" if parameter.changes is Changes.STOPPED else f", *{parameter.changes.value}*"
    what = f"{default} ({bounds}){changes}. {parameter.doc}"
    return f"- {parameter.id} `{parameter.name}`: {what}"


def _parameters() -> str:
    others = (
        f"Defaults on `{chip.name}`: "
        + ", ".join(f"`{name}` {value:.9g}" for name, value in defaults.items())
        + "."
        for chip, defaults in PLATFORM_DEFAULTS.items()
    )
    return f"""\
## Parameters

Each with its id, default and inclusive bounds. Every value is an `f32` in its unit. A
parameter changes only when *stopped* (not in DRIVING), unless it says *always*, or
*released*: neither in DRIVING nor in ESTOPPED.
{lines(others)}

{lines(map(_parameter_line, PARAMETERS))}"""


def generate() -> str:
    """The text of `MESSAGES.md`."""
    overhead = HEADER_SIZE + CRC_SIZE + FRAMING_SIZE
    test_hash = f"0x{self_test_hash():08x}"
    hashes = ", ".join(f"`{group.name}` `0x{layout_hash(group):08x}`" for group in Group)
    return f"""\
<!-- {banner("Tables")} -->
# Messages

{_INTRODUCTION.format(version=PROTOCOL_VERSION, overhead=overhead)}

Hashes of the [groups](SPEC.md#groups): {hashes}.

## From the host

{_messages(one for one in MESSAGES if not one.from_device)}
## From the device

{_messages(one for one in MESSAGES if one.from_device)}
## Fields in common

A body has these fields where its message names them; a name after the size is that of the first.

{lines(_parts())}
## Codes

[Troubleshooting](../docs/troubleshooting.md) says what to do about those that stop a robot.

{lines(chain.from_iterable(map(_codes, _CODES)))}
{_parameters()}

## Of the self-test image

Only [an image that tests a board](SPEC.md#the-self-test-image) has them. Hash: `{test_hash}`.

{_messages(SELF_TEST_MESSAGES)}
{lines(_codes(Failure))}"""
