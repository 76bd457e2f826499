"""What a peer of the codec is asked to do, and the stand-in for its serial port."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from wheelwire_protocol.messages import WHEEL_STATE
from wheelwire_protocol.types import WheelState

BODY = struct.Struct(f"<{WHEEL_STATE.body_format}")
"""A WheelState's body, for peers that carry bytes and leave their meaning to the user."""


class Peer(ABC):
    """One library: from numbers to bytes, and back from a stream.

    Attributes:
        name: Its name in tables.
        distribution: The package to install.
        remark: What readers must know to judge the row.
        encodes: Whether it can write telemetry; some libraries only read it.
        streams: Whether it takes a stream as it arrives, and not only a whole capture.
    """

    name: ClassVar[str]
    distribution: ClassVar[str]
    remark: ClassVar[str]
    encodes: ClassVar[bool] = True
    streams: ClassVar[bool] = True

    def fields(self, state: WheelState) -> Any:
        """The numbers as `encode` wants them; not part of the time measured."""
        return tuple(state)

    @abstractmethod
    def encode(self, fields: Any) -> bytes:
        """From the numbers to a frame."""

    @abstractmethod
    def decode(self, parts: Sequence[bytes]) -> Sequence[Any]:
        """All messages of a stream that arrives in these parts, in the library's own types."""

    def values(self, decoded: Any) -> tuple[Any, ...]:
        """All numbers of a decoded message: what must be equal to what was sent."""
        return tuple(decoded)


def parts_of(stream: bytes, size: int = 4096) -> list[bytes]:
    """The stream as a driver reads it."""
    return [stream[at : at + size] for at in range(0, len(stream), size)]


class SerialStandIn:
    """A serial port for libraries that pull: `read` waits for all it was asked, as pyserial's does.

    At the stream's end it returns less, as after a time-out.
    """

    def __init__(self, parts: Sequence[bytes]) -> None:
        self._parts = iter(parts)
        self._chunk = b""
        self._at = 0

    def read(self, size: int = 1) -> bytes:
        """The next `size` bytes."""
        while len(self._chunk) - self._at < size and self._refill():
            pass
        data = self._chunk[self._at : self._at + size]
        self._at += len(data)
        return data

    def readline(self) -> bytes:
        """Up to the next line feed."""
        while (end := self._chunk.find(b"\n", self._at)) < 0:
            if not self._refill():
                end = len(self._chunk)
                break
        return self.read(end + 1 - self._at)

    @property
    def exhausted(self) -> bool:
        """Whether the stream is at its end."""
        return self._at == len(self._chunk) and not self._refill()

    def _refill(self) -> bool:
        part = next(self._parts, None)
        if part is None:
            return False
        self._chunk = self._chunk[self._at :] + part
        self._at = 0
        return True
