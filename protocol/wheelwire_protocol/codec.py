"""The fast path between typed messages and payload bytes, derived from the definitions.

A payload is `id u8, seq u16, body, crc u32`, little-endian. Each message's layout, generated from
its construct, yields one `struct.Struct`; a property test compares it with construct itself.
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from . import types
from .codes import MOST_PERIPHERALS, Group
from .types import CRC_SIZE as CRC_SIZE
from .types import HEADER_SIZE as HEADER_SIZE
from .types import PROTOCOL_VERSION as PROTOCOL_VERSION
from .types import AnyMessage

MIN_PAYLOAD = HEADER_SIZE + CRC_SIZE


class Codec(NamedTuple):
    """How one message is packed and unpacked."""

    id: int
    size: int
    """Bytes of the whole payload, header and CRC included."""
    unpack: Callable[[bytes], tuple[Any, ...]]
    """Payload -> body fields; the header and the CRC are skipped."""
    type: type[Any]
    pack_body: Callable[..., bytes]
    """Body fields -> body."""
    formats: str
    """The body in the format characters of `struct`."""

    @property
    def field_formats(self) -> list[str]:
        """The format of each field."""
        return re.findall(r"\d*[A-Za-z]", self.formats)


def codec_of(message_id: int, message_type: type[Any], formats: str) -> Codec:
    """The codec of a message class whose body has these format characters of `struct`."""
    payload = struct.Struct(f"<{HEADER_SIZE}x{formats}{CRC_SIZE}x")
    return Codec(
        id=message_id,
        size=payload.size,
        unpack=payload.unpack,
        type=message_type,
        pack_body=struct.Struct(f"<{formats}").pack,
        formats=formats,
    )


BY_ID: dict[int, Codec] = {layout[0]: codec_of(*layout) for layout in types.LAYOUTS}
BY_TYPE: dict[type[Any], Codec] = {codec.type: codec for codec in BY_ID.values()}


def message_id(message_type: type[AnyMessage]) -> int:
    """The id byte of a message class."""
    return BY_TYPE[message_type].id


def schema_hash(group: Group = Group.BASE) -> int:
    """The 32-bit hash of a group's wire layout; host and device must have the same to use it."""
    return types.GROUP_HASHES[group]


# --- a board with its peripherals, as it is sent and stored ---------------------------------------

# Little-endian and without padding, as on the wire.
BOARD = struct.Struct("<" + "".join(letters for _, letters in types.BOARD_LAYOUT))
ENTRY = struct.Struct("<" + "".join(letters for _, letters in types.PERIPHERAL_LAYOUT))
# Only pins are of this format; -1: none.
_EMPTY_ENTRY = ENTRY.pack(*(-(letters == "b") for _, letters in types.PERIPHERAL_LAYOUT))


def assembled(board: bytes, entries: Sequence[bytes]) -> bytes:
    """The packed configuration of a packed board and its packed entries."""
    left_out = [_EMPTY_ENTRY] * (MOST_PERIPHERALS - len(entries))
    body = b"".join((board, bytes([len(entries)]), *entries, *left_out))
    return body + zlib.crc32(body).to_bytes(CRC_SIZE, "little")


def fingerprint_of(packed: bytes) -> int:
    """The fingerprint of a packed configuration."""
    return int.from_bytes(packed[-CRC_SIZE:], "little")
