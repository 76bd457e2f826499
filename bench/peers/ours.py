"""Wheelwire: the stream decoder that the drivers use, and the bulk decoder for captures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from wheelwire_protocol import Decoder, Encoder, decode_capture
from wheelwire_protocol.types import WheelState

from .base import Peer


class Streaming(Peer):
    """Typed messages as they arrive, loss counted."""

    name = "**wheelwire, stream**"
    distribution = "wheelwire"
    remark = "CRC-32"

    def __init__(self) -> None:
        self._encoder = Encoder()

    def encode(self, fields: Any) -> bytes:
        return self._encoder.encode(WheelState(*fields))

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        decoder, messages = Decoder(), list[Any]()
        for part in parts:
            messages += decoder.feed(part)
        return messages


class Batch(Streaming):
    """A capture into one structured array."""

    name = "**wheelwire, batch**"
    remark = "a capture into one array"
    streams = False

    def decode(self, parts: Sequence[bytes]) -> Any:
        return decode_capture(b"".join(parts), WheelState)

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(decoded.tolist())
