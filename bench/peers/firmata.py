"""pyfirmata2: Firmata, the telemetry as a SysEx message in pairs of 7 bits."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import pyfirmata2
from pyfirmata2.util import from_two_bytes, to_two_bytes

from wheelwire_protocol.types import WheelState

from .base import BODY, Peer, SerialStandIn

_COMMAND = 0x01
"""SysEx commands up to 0x0f are the user's."""


class _Line:
    """What `send_sysex` writes to."""

    def __init__(self) -> None:
        self.written = b""

    def write(self, data: bytes) -> None:
        self.written = bytes(data)


class _Board(pyfirmata2.Board):  # type: ignore[misc]  # has no type information
    """A board whose port is a stand-in; the library's own constructor opens a real one."""

    def __init__(self, port: Any) -> None:
        self.sp = port
        self.states: list[WheelState] = []
        self._command_handlers: dict[int, Any] = {}
        self.add_cmd_handler(_COMMAND, self._take)

    def __del__(self) -> None:
        """Do nothing: there is no port to close."""

    def _take(self, *data: int) -> None:
        body = bytes(map(from_two_bytes, zip(data[::2], data[1::2], strict=False)))
        if len(body) == BODY.size:
            self.states.append(WheelState(*BODY.unpack(body)))


class Pyfirmata2(Peer):
    """The meaning of the bytes is left to the user; nothing tells a damaged message."""

    name = "pyfirmata2"
    distribution = "pyfirmata2"
    remark = "no checksum; `struct`"

    def __init__(self) -> None:
        self._line = _Line()
        self._sender = _Board(self._line)

    def encode(self, fields: Any) -> bytes:
        data = [half for byte in BODY.pack(*fields) for half in to_two_bytes(byte)]
        self._sender.send_sysex(_COMMAND, data)
        return self._line.written

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        stream = SerialStandIn(parts)
        board = _Board(stream)
        with suppress(TypeError):  # the stream ended within a message
            while not stream.exhausted:
                board.iterate()
        return board.states
