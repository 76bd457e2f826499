"""The typed message classes: static types for editors and mypy, tuples for speed.

The layouts beside them are all that the fast path knows: construct takes longer to import than all
of the rest, and is the generator's and the tests' only.
"""

from __future__ import annotations

from ..message import Field, Message
from ..messages import MESSAGES
from .text import banner
from .wire_layout import layout_hash

_PYTHON_TYPES = {"f": "float"}


def _field(field: Field) -> list[str]:
    unit = f" [{field.unit.value}]" if field.unit.value else ""
    codes = f" See `codes.{field.enumeration.__name__}`." if field.enumeration else ""
    return [
        f"    {field.name}: {_PYTHON_TYPES.get(field.format, 'int')}",
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
        '"""Id, class, and the body in the format characters of `struct`, one per field."""',
        "",
        f"SCHEMA_HASH = 0x{layout_hash():08X}",
        "",
    ]
