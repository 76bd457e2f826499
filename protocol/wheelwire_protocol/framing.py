"""Frames on the wire: a delimiter on both sides, COBS between them, a CRC-32 inside. Sans-IO.

`Encoder.encode` returns the bytes to send. `decoder` has the firmware's decoder, or
`python_decoder`'s where that is missing; the tests compare the two.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from typing import Any
from zlib import crc32

from .codec import BY_ID, BY_TYPE, CRC_SIZE, Codec
from .types import AnyMessage

DELIMITER = b"\x00"

CRC_RESIDUE = 0x2144DF1C
"""CRC-32 of any payload followed by its own CRC-32, little-endian: one call checks it."""

MAX_PAYLOAD = max(codec.size for codec in BY_ID.values())
MAX_ENCODED = MAX_PAYLOAD + 1
"""The most bytes between delimiters: COBS adds one byte to payloads below 255 bytes."""

SEQ_MODULUS = 1 << 16

_CODES = [bytes([distance]) for distance in range(1, 0xFF)]
"""COBS codes, indexed by the number of non-zero bytes before the next zero."""

HEADER = struct.Struct("<BH")
"""Id and sequence number, before the body."""


@dataclass
class Counters:
    """What a decoder has seen. Every chunk that is dropped is counted here."""

    frames: int = 0
    """Good frames of known messages."""
    bad_crc: int = 0
    bad_cobs: int = 0
    """Chunks that are not COBS, or too short or too long for any message."""
    unknown_id: int = 0
    wrong_length: int = 0
    seq_lost: int = 0
    """Frames missing by their sequence numbers, without those that came late."""
    repeated: int = 0
    """Frames received more than once."""

    @property
    def bad(self) -> int:
        """Chunks that did not decode to a valid, known message."""
        return self.bad_crc + self.bad_cobs + self.unknown_id + self.wrong_length


def cobs_encode(payload: bytes) -> bytes:
    """COBS of a payload of at most 253 bytes: each zero becomes the distance to the next."""
    return b"".join([_CODES[len(run)] + run for run in payload.split(DELIMITER)])


class Encoder:
    """Encodes typed messages to frames, each with the next sequence number. Thread-safe.

    Attributes:
        encoded: Number of frames encoded.
    """

    def __init__(self) -> None:
        self.encoded = 0
        self._numbers = count()

    def encode(self, message: AnyMessage) -> bytes:
        """The frame of `message`, delimiters included.

        Raises:
            struct.error: A field does not fit its wire type.
        """
        codec = BY_TYPE[type(message)]
        # Pack before drawing a number: a field that does not fit raises, and the other side would
        # count an unused number as a lost frame.
        body = codec.pack_body(*message)
        number = next(self._numbers)  # atomic: two threads never get the same
        self.encoded = number + 1
        # As `encode_frame`, without its calls: every setpoint comes through here.
        head = HEADER.pack(codec.id, number % SEQ_MODULUS) + body
        runs = (head + crc32(head).to_bytes(CRC_SIZE, "little")).split(DELIMITER)
        frame = DELIMITER
        for run in runs:
            frame += _CODES[len(run)] + run
        return frame + DELIMITER


def encode_payload(
    message: AnyMessage, seq: int, codecs: Mapping[type[Any], Codec] = BY_TYPE
) -> bytes:
    """The payload of `message`, one of `codecs`: id, seq, body, CRC."""
    codec = codecs[type(message)]
    head = HEADER.pack(codec.id, seq) + codec.pack_body(*message)
    return head + crc32(head).to_bytes(CRC_SIZE, "little")


def encode_frame(
    message: AnyMessage, seq: int, codecs: Mapping[type[Any], Codec] = BY_TYPE
) -> bytes:
    """The frame of `message`, one of `codecs`, with a given sequence number."""
    return DELIMITER + cobs_encode(encode_payload(message, seq, codecs)) + DELIMITER
