"""The fast path between typed messages and payload bytes, derived from the definitions.

A payload is `id u8, seq u16, body, crc u32`, little-endian. Each message's construct yields one
`struct.Struct`; a property test holds it to construct itself.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Any, NamedTuple

from . import types
from .message import CRC_SIZE, HEADER_SIZE, Message
from .messages import MESSAGES
from .types import AnyMessage


class Codec(NamedTuple):
    """How one message is packed and unpacked."""

    size: int
    """Bytes of the whole payload, header and CRC included."""
    unpack: Callable[[bytes], tuple[Any, ...]]
    """Payload -> body fields; the header and the CRC are skipped."""
    type: type[Any]
    pack: Callable[..., bytes]
    """(id, seq, *body) -> payload without its CRC."""
    definition: Message


def _codec(message: Message) -> Codec:
    return Codec(
        size=message.payload_size,
        unpack=struct.Struct(f"<{HEADER_SIZE}x{message.body_format}{CRC_SIZE}x").unpack,
        type=getattr(types, message.name),
        pack=struct.Struct(f"<BH{message.body_format}").pack,
        definition=message,
    )


BY_ID: dict[int, Codec] = {message.id: _codec(message) for message in MESSAGES}
BY_TYPE: dict[type[Any], Codec] = {codec.type: codec for codec in BY_ID.values()}


def message_id(message_type: type[AnyMessage]) -> int:
    """The id byte of a message class."""
    return BY_TYPE[message_type].definition.id
