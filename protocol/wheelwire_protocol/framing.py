"""Frames on the wire: a delimiter on both sides, COBS between them, a CRC-32 inside. Sans-IO.

`Decoder.feed` takes whatever bytes have arrived; `Encoder.encode` returns the bytes to send.
Neither does I/O, neither raises on what the line brings: bad frames are counted.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from itertools import starmap
from typing import Any, cast
from zlib import crc32

from cobs import cobs

from .codec import BY_ID, BY_TYPE
from .payload import CRC_SIZE, MIN_PAYLOAD
from .types import AnyMessage

DELIMITER = b"\x00"

CRC_RESIDUE = 0x2144DF1C
"""CRC-32 of any payload followed by its own CRC-32, little-endian: one call checks it."""

MAX_PAYLOAD = max(codec.size for codec in BY_ID.values())
MAX_ENCODED = MAX_PAYLOAD + 1
"""Bytes between delimiters at most: COBS adds one byte to payloads below 255."""

SEQ_MODULUS = 1 << 16
REPEAT_WINDOW = 64
"""A frame at most this far behind is a repeat; further behind, the sender started anew."""

_HEADER = struct.Struct("<BH")
_KNOWN = {codec.id: (codec.type, codec.unpack) for codec in BY_ID.values()}
_NEW: Any = tuple.__new__
"""Makes a message of its class and the tuple of its fields, without their names being checked."""


@dataclass
class Counters:
    """What a decoder has seen. Nothing on the line is dropped without being counted here."""

    frames: int = 0
    """Good frames of known messages."""
    bad_crc: int = 0
    bad_cobs: int = 0
    """Chunks that are not COBS, or too short or too long for any message."""
    unknown_id: int = 0
    wrong_length: int = 0
    seq_lost: int = 0
    """Frames missing by their sequence numbers."""
    repeated: int = 0
    """Frames that came again."""

    @property
    def bad(self) -> int:
        """Chunks that were no good frame of a known message."""
        return self.bad_crc + self.bad_cobs + self.unknown_id + self.wrong_length


class Decoder:
    """Bytes in, typed messages out, in any chunking; at most `MAX_ENCODED` bytes are kept."""

    def __init__(self) -> None:
        self.counters = Counters()
        self._partial = b""
        self._overlong = False
        self._expected_seq: int | None = None

    def feed(self, data: bytes) -> list[AnyMessage]:
        """Decode what has arrived.

        Args:
            data: Any number of bytes, cut anywhere.

        Returns:
            The messages of the frames that were completed by `data`, in order.
        """
        chunks = (self._partial + data).split(DELIMITER)
        self._partial = chunks.pop()
        if self._overlong and chunks:
            chunks[0] = b""  # the tail of a chunk that was counted when it grew too long
            self._overlong = False
        if len(self._partial) > MAX_ENCODED:
            self.counters.bad_cobs += not self._overlong
            self._overlong = True
        if self._overlong:
            self._partial = b""
        return self._decode(chunks)

    def restart_sequence(self) -> None:
        """Expect any sequence number next: the sender is known to have started anew."""
        self._expected_seq = None

    def _decode(self, chunks: list[bytes]) -> list[AnyMessage]:
        # One loop without calls into Python: this is what an hour of 1 kHz state frames costs.
        # It only tells good frames from the rest; `_reject` finds out what was wrong.
        decode_cobs, read_header, known = cobs.decode, _HEADER.unpack_from, _KNOWN
        expected = self._expected_seq
        frames: list[tuple[type[Any], tuple[Any, ...]]] = []
        append = frames.append
        for chunk in filter(None, chunks):
            try:
                payload = decode_cobs(chunk)
                message_id, seq = read_header(payload)
                message_type, unpack = known[message_id]
                fields = unpack(payload)
            except (cobs.DecodeError, KeyError, struct.error):
                expected = self._reject(chunk, expected)
                continue
            if crc32(payload) != CRC_RESIDUE:
                self.counters.bad_crc += 1
                continue
            if seq != expected:
                seq = self._count_gap(seq, expected)
            expected = seq + 1  # 65536 too, which `_count_gap` takes for 0
            append((message_type, fields))
        self.counters.frames += len(frames)
        self._expected_seq = expected
        return list(starmap(_NEW, frames))

    def _reject(self, chunk: bytes, expected: int | None) -> int | None:
        """Count a chunk that is no good frame of a known message; returns the seq to expect."""
        try:
            payload = cobs.decode(chunk)
        except cobs.DecodeError:
            payload = b""
        if not MIN_PAYLOAD <= len(payload) <= MAX_PAYLOAD:
            self.counters.bad_cobs += 1
            return expected
        if crc32(payload) != CRC_RESIDUE:
            self.counters.bad_crc += 1
            return expected
        message_id, seq = _HEADER.unpack_from(payload)
        if message_id in _KNOWN:
            self.counters.wrong_length += 1
        else:
            self.counters.unknown_id += 1
        return self._count_gap(seq, expected) + 1

    def _count_gap(self, seq: int, expected: int | None) -> int:
        """Account for a frame that may be out of order; returns the seq to go on from."""
        if expected is None:
            return seq
        ahead = (seq - expected) % SEQ_MODULUS
        if ahead < SEQ_MODULUS // 2:
            self.counters.seq_lost += ahead
            return seq
        if SEQ_MODULUS - ahead <= REPEAT_WINDOW:
            self.counters.repeated += 1
            return expected - 1
        return seq


class Encoder:
    """Typed messages in, frames out, each with the next sequence number."""

    def __init__(self) -> None:
        self._seq = 0

    def encode(self, message: AnyMessage) -> bytes:
        """The frame of `message`, delimiters included.

        Raises:
            struct.error: A field does not fit its wire type.
        """
        frame = encode_frame(message, self._seq)
        self._seq = (self._seq + 1) % SEQ_MODULUS
        return frame


def encode_payload(message: AnyMessage, seq: int) -> bytes:
    """The payload of `message`: id, seq, body, CRC."""
    codec = BY_TYPE[type(message)]
    head = codec.pack(codec.id, seq, *message)
    return head + crc32(head).to_bytes(CRC_SIZE, "little")


def encode_frame(message: AnyMessage, seq: int) -> bytes:
    """The frame of `message` with a given sequence number."""
    return DELIMITER + cast(bytes, cobs.encode(encode_payload(message, seq))) + DELIMITER
