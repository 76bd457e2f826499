"""Messages that are published often: serialised once, then only their numbers are replaced.

To build a ROS message in Python and convert it to C costs several times what its publication costs.
Where the numbers lie in the serialised message is found with the middleware's own serialisation, by
values that occur nowhere else in it.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Sequence
from typing import Any

from rclpy.serialization import serialize_message

NATIVE = "="
"""Byte order of the middleware of this computer, without padding."""


class MessageTemplate:
    """A serialised message.

    Args:
        message: Its constant part.
        fields: Path and format of each number that is replaced, the format as in `struct`:
            `("pose.pose.position.x", "d")`, `("transforms.0.header.stamp.sec", "i")`, or an array,
            `("pose.covariance", "36d")`.

    Raises:
        ValueError: A field is not found exactly once in the serialised message.
    """

    def __init__(self, message: Any, fields: Sequence[tuple[str, str]]) -> None:
        # The same numbers in every process: whether each is found once does not depend on luck.
        chance = random.Random(1)
        self._fields: list[tuple[struct.Struct, int]] = []
        marked: list[tuple[str, bytes]] = []
        for path, format_ in fields:
            code = struct.Struct(NATIVE + format_)
            count = len(code.unpack(bytes(code.size)))
            is_real = format_[-1] == "d"
            # Whole numbers are below 2^29, so that they fit signed fields of 32 bits, too.
            marks = [
                chance.random() if is_real else chance.randrange(1 << 29) for _ in range(count)
            ]
            _set(message, path, marks if format_[:-1] else marks[0])
            marked.append((path, code.pack(*marks)))
        self._buffer = bytearray(serialize_message(message))
        for (path, mark), (_, format_) in zip(marked, fields, strict=True):
            if self._buffer.count(mark) != 1:
                # A number in the wrong place would be published as a good message.
                raise ValueError(f"{path} is not found in the serialised {type(message).__name__}")
            self._fields.append((struct.Struct(NATIVE + format_), self._buffer.index(mark)))

    def fill(self, *values: Sequence[float]) -> bytes:
        """The message with these values, one sequence a field in the order of the fields."""
        for (code, offset), numbers in zip(self._fields, values, strict=True):
            code.pack_into(self._buffer, offset, *numbers)
        return bytes(self._buffer)


def _set(message: Any, path: str, value: Any) -> None:
    *parents, last = path.split(".")
    for parent in parents:
        message = message[int(parent)] if parent.isdigit() else getattr(message, parent)
    setattr(message, last, value)
