"""The typed message classes: static types for editors and mypy, tuples for speed.

The fast path uses only the layouts written next to them. Only the generator and the tests use
construct, which takes longer to import than everything else.
"""

from __future__ import annotations

from collections.abc import Iterable

from ..board_layout import Board, Peripheral
from ..codes import Group
from ..message import CRC_SIZE, HEADER_SIZE, Field, Message, fields_of
from ..messages import MESSAGES, PROTOCOL_VERSION, Ping
from ..self_test import MESSAGES as SELF_TEST_MESSAGES
from .text import banner, field_note, lines
from .wire_layout import layout_hash, self_test_hash

_PYTHON_TYPES = {"f": "float"}


def _field(field: Field) -> str:
    codes = f"See `codes.{field.enumeration.__name__}`." if field.enumeration else ""
    note = f"{field_note(field)} {codes}".strip()
    kind = "bytes" if field.is_text else _PYTHON_TYPES.get(field.format, "int")
    return f"    {field.name}: {kind}" + (f'\n    """{note}"""' if note else "")


def _message(message: Message) -> str:
    return f'''\
class {message.name}(NamedTuple):
    """{message.doc}"""

{lines(map(_field, message.fields))}

'''


def _union(name: str, alternatives: Iterable[str]) -> str:
    joined = "\n    | ".join(alternatives)
    return f"{name} = (\n    {joined}\n)"


def _layouts(kind: str, messages: Iterable[Message]) -> str:
    return f'''\
LAYOUTS: tuple[tuple[int, type[{kind}], str], ...] = (
{lines(f'    (0x{m.id:02X}, {m.name}, "{m.body_format}"),' for m in messages)}
)
"""Id, class, and the body in the format characters of `struct`."""'''


def _packed_layout(what: str, fields: Iterable[Field]) -> str:
    return f'''\
{what.upper()}_LAYOUT: tuple[tuple[str, str], ...] = (
{lines(f'    ("{f.name}", "{f.format}"),' for f in fields)}
)
"""The fields of the packed {what}, and their format characters."""'''


def generate() -> str:
    """The text of `types.py`."""
    # A ping is never repeated: the time of its copy's answer would mean nothing.
    requests = [m for m in MESSAGES if m.is_request and m is not Ping.message]
    answered = [m for m in requests if m.answer]
    answers = dict.fromkeys(["Ack", *(m.answer for m in answered)])
    grouped = [m for m in MESSAGES if m.group is not Group.BASE]
    return f'''\
"""The messages as typed tuples, one class each.

{banner("Python types")}
"""

from typing import NamedTuple

from .codes import Group

PROTOCOL_VERSION = {PROTOCOL_VERSION}
HEADER_SIZE = {HEADER_SIZE}
CRC_SIZE = {CRC_SIZE}
"""Around the body of every payload: `id u8, seq u16` before it, `crc u32` after it."""


{lines(map(_message, MESSAGES))}
{_union("AnyMessage", (m.name for m in MESSAGES))}

{_union("AnyRequest", (m.name for m in requests))}

{_union("AnyAnswer", answers)}

ANSWERS: dict[type[AnyMessage], type[AnyAnswer]] = {{
{lines(f"    {m.name}: {m.answer}," for m in answered)}
}}
"""What answers a request; all others are answered by an Ack."""

READ_ONLY: tuple[type[AnyRequest], ...] = (
{lines(f"    {m.name}," for m in requests if m.reads)}
)
"""Requests that change nothing."""

{_layouts("AnyMessage", MESSAGES)}

{_packed_layout("board", fields_of(Board))}

{_packed_layout("peripheral", fields_of(Peripheral))}

GROUP_HASHES: dict[Group, int] = {{
{lines(f"    Group.{g.name}: 0x{layout_hash(g):08X}," for g in Group)}
}}
SCHEMA_HASH = GROUP_HASHES[Group.BASE]

GROUPS: dict[type[AnyMessage], Group] = {{
{lines(f"    {m.name}: Group.{m.group.name}," for m in grouped)}
}}
"""The groups of the messages that not every device has."""
'''


def generate_self_test() -> str:
    """The text of `self_test_types.py`, which only the tests of a board need."""
    return f'''\
"""The messages of the self-test image as typed tuples, one class each.

{banner("Python types")}
"""

from __future__ import annotations

from typing import Any, NamedTuple

HASH = 0x{self_test_hash():08X}


{lines(map(_message, SELF_TEST_MESSAGES))}
{_layouts("Any", SELF_TEST_MESSAGES)}
'''
