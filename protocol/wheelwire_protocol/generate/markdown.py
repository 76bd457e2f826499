"""MESSAGES.md: every message, code and parameter as tables for people."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from itertools import chain

from ..board import CODES as BOARD_CODES
from ..codes import ENUMERATIONS, FLAGS, RECORDER_CODES, DocumentedEnum, DocumentedFlag, Group
from ..message import Field, Message
from ..messages import MESSAGES, PROTOCOL_VERSION
from ..parameters import PARAMETERS, PLATFORM_DEFAULTS, Kind, Parameter
from ..sensors import CODES as SENSOR_CODES
from ..sensors import FLAGS as SENSOR_FLAGS
from .text import banner
from .wire_layout import layout_hash

_ENUMERATIONS = (*ENUMERATIONS, *BOARD_CODES, *RECORDER_CODES, *SENSOR_CODES)

FRAMING_SIZE = 3
"""Bytes a frame has beyond its payload: one COBS code, two delimiters."""

_INTRODUCTION = """\
Protocol version {version}, schema hash `0x{hash:08x}` of the group BASE. How the messages work
together is in [SPEC.md](SPEC.md).

Sizes are in bytes: *body* is the fields alone, *frame* is all that is sent, with id, seq, CRC, COBS
and delimiters. Types are little-endian and packed: `u16` is an unsigned, `i16` a signed integer of
16 bits, `f32` an IEEE 754 binary32, `char[n]` n bytes, of a name its ASCII filled up with zeros. A
*frozen* message has the same layout in every protocol version."""


def wire_type(field: Field) -> str:
    """`u16`, `i32`, `f32`: the type of a field on the wire."""
    if field.is_text:
        return f"char[{field.subcon.length}]"
    kind = "f" if field.format == "f" else "u" if field.format.isupper() else "i"
    return f"{kind}{8 * struct.calcsize('<' + field.format)}"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    titles = list(head)
    lines = [titles, ["-"] * len(titles), *rows]
    return [f"| {' | '.join(cells)} |".replace("|  |", "| |") for cells in lines] + [""]


def _anchor(name: str) -> str:
    return f"[{name}](#{name.lower()})"


def _overview(messages: Iterable[Message]) -> list[str]:
    return _table(
        ("id", "message", "body", "frame", "meaning"),
        (
            (
                f"`0x{message.id:02x}`",
                _anchor(message.name),
                str(message.body_size),
                str(message.payload_size + FRAMING_SIZE),
                message.doc,
            )
            for message in messages
        ),
    )


def _field_row(field: Field) -> tuple[str, ...]:
    codes = f" {_anchor(field.enumeration.__name__)}." if field.enumeration else ""
    return (f"`{field.name}`", wire_type(field), field.unit.value, f"{field.docs}{codes}")


def _message(message: Message) -> list[str]:
    frozen = ", frozen" if message.frozen else ""
    return [
        f"### {message.name}",
        "",
        f"`0x{message.id:02x}`, body {message.body_size}, "
        f"frame {message.payload_size + FRAMING_SIZE}{frozen}. {message.doc}",
        "",
        *_table(("field", "type", "unit", "meaning"), map(_field_row, message.fields)),
    ]


def _codes(
    codes: type[DocumentedEnum] | type[DocumentedFlag], number: str, remark: str = ""
) -> list[str]:
    rows = ((str(m.value), f"`{m.name}`", m.doc) for m in codes)
    return [
        f"### {codes.__name__}",
        "",
        (codes.__doc__ or "").strip() + remark,
        "",
        *_table((number, "name", "meaning"), rows),
    ]


def _parameter_row(parameter: Parameter) -> tuple[str, ...]:
    bounds = f"{parameter.minimum:.9g} to {parameter.maximum:.9g}"
    if parameter.kind is Kind.SWITCH:
        bounds = "0, 1"
    return (
        str(parameter.id),
        f"`{parameter.name}`",
        parameter.unit.value,
        parameter.kind.value,
        f"{parameter.default:.9g}",
        bounds,
        parameter.changes.value,
        parameter.doc,
    )


def _parameters() -> list[str]:
    return [
        "## Parameters",
        "",
        "Every value travels as `f32`. A *whole* one takes whole numbers only, a *switch* 0 or 1.",
        "Bounds are inclusive. *Changes* says when another value is taken: *always*, or only when",
        "*stopped*, so not in DRIVING, or *released*, so neither in DRIVING nor in ESTOPPED.",
        "",
        *_table(
            ("id", "name", "unit", "kind", "default", "bounds", "changes", "meaning"),
            map(_parameter_row, PARAMETERS),
        ),
        "Other defaults by board:",
        "",
        *_table(
            ("board", "parameter", "default"),
            (
                (f"`{board.name}`", f"`{name}`", f"{value:.9g}")
                for board, defaults in PLATFORM_DEFAULTS.items()
                for name, value in defaults.items()
            ),
        ),
    ]


def _contents(from_host: list[Message], from_device: list[Message]) -> list[str]:
    codes = ", ".join(_anchor(e.__name__) for e in (*_ENUMERATIONS, *FLAGS, *SENSOR_FLAGS))
    return [
        "**From the host**",
        "",
        *_overview(from_host),
        "**From the device**",
        "",
        *_overview(from_device),
        "**Groups**: every device has the first. A message of another group may be sent once its",
        "hash is known to be the same on both sides, by GroupGet.",
        "",
        *_groups(),
        f"**Codes**: {codes}.",
        "",
        f"**{_anchor('Parameters')}**: {len(PARAMETERS)}.",
        "",
    ]


def _groups() -> list[str]:
    rows = (
        (
            str(group.value),
            f"`{group.name}`",
            f"`0x{layout_hash(group):08x}`",
            ", ".join(_anchor(m.name) for m in MESSAGES if m.group is group)
            if group
            else "all others",
        )
        for group in Group
    )
    return _table(("group", "name", "hash", "messages"), rows)


def generate() -> str:
    """The text of `MESSAGES.md`."""
    from_host = [message for message in MESSAGES if not message.from_device]
    from_device = [message for message in MESSAGES if message.from_device]
    lines = [
        f"<!-- {banner('Tables')} -->",
        "# Messages",
        "",
        _INTRODUCTION.format(version=PROTOCOL_VERSION, hash=layout_hash()),
        "",
        *_contents(from_host, from_device),
        "## From the host",
        "",
        *chain.from_iterable(map(_message, from_host)),
        "## From the device",
        "",
        *chain.from_iterable(map(_message, from_device)),
        "## Codes",
        "",
        *chain.from_iterable(_codes(each, "code") for each in _ENUMERATIONS),
        *chain.from_iterable(
            _codes(each, "bit", " Several may be set at once.") for each in (*FLAGS, *SENSOR_FLAGS)
        ),
        *_parameters(),
    ]
    return "\n".join(lines)
