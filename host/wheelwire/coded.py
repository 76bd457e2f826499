"""Wire values into enumeration members."""

from __future__ import annotations

import enum
from typing import TypeVar

E = TypeVar("E", bound=enum.Enum)


def member(enumeration: type[E], value: int) -> E:
    """The member of a wire value. Type checkers take the plain call for that of a new member.

    Raises:
        ValueError: The value has no meaning.
    """
    return enumeration(value)
