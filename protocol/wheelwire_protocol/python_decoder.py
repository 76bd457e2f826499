"""The decoder in Python: the fall-back where the firmware's library is missing, and its oracle."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from itertools import starmap
from typing import Any
from zlib import crc32

from .codec import BY_ID, MIN_PAYLOAD, Codec
from .framing import CRC_RESIDUE, DELIMITER, HEADER, MAX_ENCODED, MAX_PAYLOAD, SEQ_MODULUS, Counters
from .types import AnyMessage

REPEAT_WINDOW = 64
"""A frame at most this far behind is late or a repeat; further behind, the sender restarted."""

_WINDOW = (1 << REPEAT_WINDOW) - 1
_NEW: Any = tuple.__new__
"""Creates a message from its class and the tuple of its fields, faster than calling the class."""


class PythonDecoder:
    """Decodes bytes, cut anywhere, to typed messages. Keeps at most `MAX_ENCODED` bytes.

    Args:
        codecs: Of the messages that it knows.
    """

    def __init__(self, codecs: Mapping[int, Codec] = BY_ID) -> None:
        self._known = {codec.id: (codec.type, codec.unpack) for codec in codecs.values()}
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
        # By `split`, because a loop over the bytes costs more than the rest of the decoder.
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
                message_id, seq = HEADER.unpack_from(payload)
                message_type, unpack = self._known[message_id]
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
        message_id, seq = HEADER.unpack_from(payload)
        if message_id in self._known:
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
            # The sender restarted: frames that were missing before can no longer arrive late.
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
