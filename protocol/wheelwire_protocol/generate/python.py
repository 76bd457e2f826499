"""The typed message classes: static types for editors and mypy, tuples for speed.

The layouts beside them are all that the fast path knows: construct takes longer to import than all
of the rest, and is the generator's and the tests' only.
"""

from __future__ import annotations

from ..codes import Group
from ..message import CRC_SIZE, HEADER_SIZE, Field, Message
from ..messages import MESSAGES, PROTOCOL_VERSION, board_fields, peripheral_fields
from .text import banner
from .wire_layout import layout_hash

_PYTHON_TYPES = {"f": "float"}


def _field(field: Field) -> list[str]:
    unit = f" [{field.unit.value}]" if field.unit.value else ""
    codes = f" See `codes.{field.enumeration.__name__}`." if field.enumeration else ""
    return [
        f"    {field.name}: {'bytes' if field.is_text else _PYTHON_TYPES.get(field.format, 'int')}",
        f'    """{field.docs}{unit}{codes}"""',
    ]


def _message(message: Message) -> list[str]:
    lines = [f"class {message.name}(NamedTuple):", f'    """{message.doc}"""', ""]
    for field in message.fields:
        lines += _field(field)
    return [*lines, "", ""]


def generate() -> str:
    """The text of `types.py`."""
    lines = [
        '"""The messages as typed tuples, one class each.',
        "",
        banner("Python types"),
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "from typing import NamedTuple",
        "",
        "from .codes import Group",
        "",
        f"PROTOCOL_VERSION = {PROTOCOL_VERSION}",
        f"HEADER_SIZE = {HEADER_SIZE}",
        f"CRC_SIZE = {CRC_SIZE}",
        '"""Around the body of every payload: `id u8, seq u16` before it, `crc u32` after it."""',
        "",
        "",
    ]
    for message in MESSAGES:
        lines += _message(message)
    alternatives = "\n    | ".join(message.name for message in MESSAGES)
    return "\n".join([*lines, "AnyMessage = (", f"    {alternatives}", ")", "", *_layouts()])


def _layouts() -> list[str]:
    return [
        "LAYOUTS: tuple[tuple[int, type[AnyMessage], str], ...] = (",
        *(f'    (0x{m.id:02X}, {m.name}, "{m.body_format}"),' for m in MESSAGES),
        ")",
        '"""Id, class, and the body in the format characters of `struct`."""',
        "",
        *_board_layout(),
        "",
        *_peripheral_layout(),
        "",
        "GROUP_HASHES: dict[Group, int] = {",
        *(f"    Group.{g.name}: 0x{layout_hash(g):08X}," for g in Group),
        "}",
        "SCHEMA_HASH = GROUP_HASHES[Group.BASE]",
        "",
        "GROUPS: dict[type[AnyMessage], Group] = {",
        *(f"    {m.name}: Group.{m.group.name}," for m in MESSAGES if m.group is not Group.BASE),
        "}",
        '"""The groups of the messages that not every device has."""',
        "",
    ]


def _board_layout() -> list[str]:
    return [
        "BOARD_LAYOUT: tuple[tuple[str, str], ...] = (",
        *(f'    ("{f.name}", "{f.format}"),' for f in board_fields()),
        ")",
        '"""The fields of the packed board, and their format characters."""',
    ]


def _peripheral_layout() -> list[str]:
    return [
        "PERIPHERAL_LAYOUT: tuple[tuple[str, str], ...] = (",
        *(f'    ("{f.name}", "{f.format}"),' for f in peripheral_fields()),
        ")",
        '"""The fields of the packed peripheral, and their format characters."""',
    ]
