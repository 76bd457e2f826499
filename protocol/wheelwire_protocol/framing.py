"""Frames on the wire: a delimiter on both sides, COBS between them, a CRC-32 inside. Sans-IO.

`Encoder.encode` returns the bytes to send. `PythonDecoder` is used where the firmware's decoder is
missing, and the tests compare the two.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from itertools import count, starmap
from typing import Any
from zlib import crc32

from .codec import BY_ID, BY_TYPE, CRC_SIZE, MIN_PAYLOAD
from .types import AnyMessage

DELIMITER = b"\x00"

CRC_RESIDUE = 0x2144DF1C
"""CRC-32 of any payload followed by its own CRC-32, little-endian: one call checks it."""

MAX_PAYLOAD = max(codec.size for codec in BY_ID.values())
MAX_ENCODED = MAX_PAYLOAD + 1
"""The most bytes between delimiters: COBS adds one byte to payloads below 255 bytes."""

SEQ_MODULUS = 1 << 16
REPEAT_WINDOW = 64
"""A frame at most this far behind is late or a repeat; further behind, the sender restarted."""

_CODES = [bytes([distance]) for distance in range(1, 0xFF)]
"""COBS codes, indexed by the number of non-zero bytes before the next zero."""

_WINDOW = (1 << REPEAT_WINDOW) - 1
_HEADER = struct.Struct("<BH")
_KNOWN = {codec.id: (codec.type, codec.unpack) for codec in BY_ID.values()}
_NEW: Any = tuple.__new__
"""Creates a message from its class and the tuple of its fields, faster than calling the class."""


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
    """Frames missing by their sequence numbers, less those that came late."""
    repeated: int = 0
    """Frames received more than once."""

    @property
    def bad(self) -> int:
        """Chunks that did not decode to a valid, known message."""
        return self.bad_crc + self.bad_cobs + self.unknown_id + self.wrong_length


class PythonDecoder:
    """Decodes bytes, cut anywhere, to typed messages. Keeps at most `MAX_ENCODED` bytes."""

    def __init__(self) -> None:
        self.counters = Counters()
        """What it has seen so far."""
        self._partial = b""
        self._overlong = False
        self._expected_seq: int | None = None
        self._missed = 0
        """Bit n: the frame n + 1 before the one expected when `_missed_at` frames had come was
        missing. Relative to that count, so that frames in order, nearly all, need not shift it."""
        self._missed_at = 0

    def feed(self, data: bytes) -> list[AnyMessage]:
        """Decode what has arrived.

        Args:
            data: Any number of bytes, cut anywhere.

        Returns:
            The messages of the frames that were completed by `data`, in order.
        """
        # By `split`, since a loop over the bytes costs more than all the rest of the decoder.
        chunks = (self._partial + data).split(DELIMITER)
        # The last one has no delimiter behind it yet.
        self._partial = chunks.pop()
        if self._overlong and chunks:
            chunks[0] = b""  # the tail of an overlong chunk, which was counted already
            self._overlong = False
        if len(self._partial) > MAX_ENCODED:
            # Counted here, not at its end: a line without delimiters is to be noticed, too.
            self.counters.bad_cobs += not self._overlong
            self._overlong = True
        if self._overlong:
            self._partial = b""
        return self._decode(chunks)

    @property
    def seq_lost(self) -> int:
        """As `counters.seq_lost`."""
        return self.counters.seq_lost

    def restart_sequence(self) -> None:
        """Accept any sequence number next, because the sender has restarted."""
        self._expected_seq = None

    def restart(self) -> None:
        """Forget a partial frame and the sequence: the line was reopened. Keeps the counters."""
        self._partial = b""
        self._overlong = False
        self._expected_seq = None

    def _decode(self, chunks: list[bytes]) -> list[AnyMessage]:
        expected = self._expected_seq
        frames: list[tuple[type[Any], tuple[Any, ...]]] = []
        for chunk in filter(None, chunks):
            try:
                # All that can fail comes before the CRC, so that good chunks pass one `try` only.
                # Fields of a chunk with a wrong CRC are dropped below.
                payload = _unstuff(chunk)
                message_id, seq = _HEADER.unpack_from(payload)
                message_type, unpack = _KNOWN[message_id]
                fields = unpack(payload)
            except (ValueError, KeyError, struct.error):
                # Only now is it worth finding out why: bad chunks are rare.
                expected = self._reject(chunk, expected, self.counters.frames + len(frames))
                continue
            if crc32(payload) != CRC_RESIDUE:
                self.counters.bad_crc += 1
                continue
            if seq != expected:
                taken = self.counters.frames + len(frames)
                seq = self._count_gap(seq, expected, taken, delivered=True)
            expected = seq + 1  # may be 65536: then `_count_gap` counts modulo
            frames.append((message_type, fields))
        self.counters.frames += len(frames)
        self._expected_seq = expected
        return list(starmap(_NEW, frames))

    def _reject(self, chunk: bytes, expected: int | None, taken: int) -> int | None:
        """Count a chunk that is not a valid, known message; returns the seq to expect."""
        # The checks are in the order of SPEC.md: the first one that fails gives the counter.
        try:
            payload = _unstuff(chunk)
        except ValueError:
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
        # It arrived undamaged, so its number is not missing.
        return self._count_gap(seq, expected, taken, delivered=False) + 1

    def _count_gap(self, seq: int, expected: int | None, taken: int, *, delivered: bool) -> int:
        """Account for a frame that may be out of order; returns the seq to continue from.

        Args:
            seq: The frame's number.
            expected: The number expected; None for the first frame.
            taken: Frames delivered before it.
            delivered: Whether it is delivered itself.
        """
        in_order, self._missed_at = taken - self._missed_at, taken
        # Shift in the frames that came in order since. The window is then relative to `expected`;
        # this frame, if it is delivered, will shift it by one more.
        self._missed = self._missed << in_order & _WINDOW if in_order < REPEAT_WINDOW else 0
        ahead = 0 if expected is None else (seq - expected) % SEQ_MODULUS
        behind = SEQ_MODULUS - ahead
        if expected is not None and behind <= REPEAT_WINDOW:
            self._count_late(1 << behind - 1)
            self._missed_at += delivered  # a late frame does not move the window
            return expected - 1
        if expected is None or ahead >= SEQ_MODULUS // 2:
            # The sender started anew: nothing that was missing before can come late any more.
            self._missed = 0
        else:
            self.counters.seq_lost += ahead
            # Shifts in `ahead` bits that are set, one for each frame that is missing.
            self._missed = (self._missed + 1 << ahead) - 1 & _WINDOW
        if not delivered:
            # A delivered frame raises the next call's `taken`, which shifts. This one does not.
            self._missed = self._missed << 1 & _WINDOW
        return seq

    def _count_late(self, bit: int) -> None:
        if self._missed & bit:
            self._missed -= bit
            self.counters.seq_lost -= 1
        else:
            self.counters.repeated += 1


def _unstuff(chunk: bytes) -> bytes:
    """Decode the COBS of a chunk without zeros. Raises `ValueError` if it is not valid.

    Payloads are too short for the code 0xFF, so each code but the first replaces a zero.
    """
    payload = bytearray(chunk)
    at = 0
    # Ends, because no code is zero: the chunk has no zeros.
    while at < len(payload):
        code = payload[at]
        payload[at] = 0
        at += code
    if at != len(payload):
        raise ValueError("the last code points beyond the end")
    return bytes(payload[1:])


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
        # Packed before a number is drawn: a field that does not fit raises, and a number that is
        # never sent would count as a lost frame on the other side.
        body = codec.pack_body(*message)
        number = next(self._numbers)  # atomic: two threads never get the same
        self.encoded = number + 1
        # As `encode_frame`, without its calls: every setpoint comes through here.
        head = _HEADER.pack(codec.id, number % SEQ_MODULUS) + body
        runs = (head + crc32(head).to_bytes(CRC_SIZE, "little")).split(DELIMITER)
        frame = DELIMITER
        for run in runs:
            frame += _CODES[len(run)] + run
        return frame + DELIMITER


def encode_payload(message: AnyMessage, seq: int) -> bytes:
    """The payload of `message`: id, seq, body, CRC."""
    codec = BY_TYPE[type(message)]
    head = _HEADER.pack(codec.id, seq) + codec.pack_body(*message)
    return head + crc32(head).to_bytes(CRC_SIZE, "little")


def encode_frame(message: AnyMessage, seq: int) -> bytes:
    """The frame of `message` with a given sequence number."""
    return DELIMITER + cobs_encode(encode_payload(message, seq)) + DELIMITER
