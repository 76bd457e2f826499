"""Tables of the firmware's headers: a C++ struct, and an array of it."""

from __future__ import annotations

import enum
from collections.abc import Callable, Mapping
from typing import Any

from .cpp import cpp_number
from .text import constant_name, lines


def cpp_table(
    name: str, doc: str, columns: str, rows: Mapping[Any, Any], **computed: Callable[[Any], Any]
) -> str:
    """A struct, and the array `k<name>s` of it.

    Args:
        name: Of the struct.
        doc: Of the struct.
        columns: One member a line: its C++ type; its name, with an integer's format after a colon;
            and its meaning. The first is the key.
        rows: By their keys.
        computed: Member name -> how to get its value from a row. Other members have the same name
            in the row.
    """
    cells = [line.split(maxsplit=2) for line in columns.strip().splitlines()]
    members, values = [], []
    for kind, column, *docs in cells:
        member, _, format_ = column.partition(":")
        members.append(f"{kind} {member};{''.join(f'  ///< {text}' for text in docs)}")
        values.append((member.partition("[")[0], format_))

    def literals(key: Any, row: Any) -> str:
        given = (
            computed[member](row) if member in computed else getattr(row, member)
            for member, _ in values[1:]
        )
        return ", ".join(map(cpp_literal, (key, *given), (format_ for _, format_ in values)))

    return f"""\
/// {doc}
struct {name} {{
{lines(members)}
}};

constexpr {name} k{name}s[] = {{
{lines(f"{{{literals(key, row)}}}," for key, row in rows.items())}
}};"""


def cpp_literal(value: Any, format_: str = "") -> str:
    """A value in C++; a set of pins is a mask."""
    if isinstance(value, enum.Enum):
        return f"{type(value).__name__}::{constant_name(value.name)}"
    if isinstance(value, tuple):
        return f"{{{', '.join(cpp_literal(one, format_) for one in value)}}}"
    if isinstance(value, frozenset):
        return f"0x{sum(1 << pin for pin in value):x}"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return cpp_number(value)
    return f"0x{value:{format_}}" if format_ else str(value)
