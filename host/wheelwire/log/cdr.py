"""ROS 2 messages as they cross a middleware: plain CDR, little-endian.

The code lays a message out once, field by field, and then fills in what changes.
"""

from __future__ import annotations

import struct

HEADER = b"\x00\x01\x00\x00"
"""Plain CDR, little-endian. Fields are aligned relative to what follows it."""


class Layout:
    """One message's fields, appended in the order of its definition.

    Each method returns the layout itself. `number` and `numbers` take codes of `struct`; without
    a value they leave a place, which `fill` fills.
    """

    def __init__(self) -> None:
        self._buffer = bytearray(HEADER)
        self._runs: list[tuple[int, str, int]] = []
        """Places that lie side by side: offset, format and number."""

    def number(self, code: str, value: float | None = None) -> Layout:
        """One number of a fixed size."""
        return self.numbers(code, 1, None if value is None else (value,))

    def numbers(self, code: str, count: int, values: tuple[float, ...] | None = None) -> Layout:
        """An array whose length is in the message's definition."""
        if count:
            one = struct.calcsize("<" + code)
            before = len(self._buffer)
            padding = -(before - len(HEADER)) % one
            self._buffer += bytes(padding + one * count)
            if values is not None:
                struct.pack_into(f"<{count}{code}", self._buffer, before + padding, *values)
            else:
                self._leave(before, padding, f"{count}{code}", count)
        return self

    def _leave(self, before: int, padding: int, format_: str, count: int) -> None:
        if self._runs:
            offset, run, places = self._runs[-1]
            if offset + struct.calcsize(run) == before:  # one call fills both
                self._runs[-1] = offset, f"{run}{padding}x{format_}", places + count
                return
        self._runs.append((before + padding, "<" + format_, count))

    def sequence(self, code: str, count: int) -> Layout:
        """An array whose length is in the message."""
        return self.number("I", count).numbers(code, count)

    def text(self, value: str) -> Layout:
        """A string."""
        data = value.encode() + b"\0"
        self.number("I", len(data))
        self._buffer += data
        return self

    def texts(self, *values: str) -> Layout:
        """A sequence of strings."""
        self.number("I", len(values))
        for value in values:
            self.text(value)
        return self

    def fill(self, *values: float) -> bytes:
        """The message with these numbers at the places left for them, in order."""
        begin = 0
        for offset, format_, count in self._runs:
            struct.pack_into(format_, self._buffer, offset, *values[begin : begin + count])
            begin += count
        return bytes(self._buffer)
