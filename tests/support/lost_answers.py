"""Loses a device's answers on their way to a host, in real time."""

from __future__ import annotations

import pytest

from wheelwire.link.transports import SocketTransport
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import AnyMessage

DELIMITER = b"\0"


class LostAnswers:
    """Of every simulated robot, each message of `kind` is lost until `left` of them were.

    Attributes:
        left: How many are still to be lost.
    """

    def __init__(self, patch: pytest.MonkeyPatch, kind: type[AnyMessage], left: int) -> None:
        self.left = left
        self._kind = kind
        self._rest = b""
        read = SocketTransport.read
        patch.setattr(SocketTransport, "read", lambda port: self._pass(read(port)))

    def _pass(self, data: bytes) -> bytes:
        *frames, self._rest = (self._rest + data).split(DELIMITER)
        return b"".join(frame + DELIMITER for frame in frames if not self._loses(frame))

    def _loses(self, frame: bytes) -> bool:
        messages = Decoder().feed(DELIMITER + frame + DELIMITER)
        loses = self.left > 0 and any(isinstance(message, self._kind) for message in messages)
        self.left -= loses
        return loses
