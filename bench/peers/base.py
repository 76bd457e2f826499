"""What a peer of the codec is asked to do."""

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
        streams: Whether it takes a stream as it arrives, and not only a whole capture.
    """

    name: ClassVar[str]
    distribution: ClassVar[str]
    remark: ClassVar[str]
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
