"""Captures decoded in bulk: every frame of one message, as a numpy structured array.

The same frames come out as from `framing.Decoder`, whatever is wrong with the capture. Frames of
one message are of one length, so those found between delimiters are the rows of a table, and each
step of decoding is done to a whole column of it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .codec import BY_TYPE
from .framing import CRC_RESIDUE
from .message import CRC_SIZE, HEADER_SIZE, Field
from .types import AnyMessage

_BLOCK_SIZE = 1 << 19
"""Bytes of a capture worked on at once: enough to outweigh the calls, few enough for the cache."""

_REFLECTED_POLYNOMIAL = 0xEDB88320
"""CRC-32's 0x04C11DB7 with its bits in reverse."""


def _scalar(field: Field) -> str:
    kind = "f" if field.format == "f" else "u" if field.format.isupper() else "i"
    return f"<{kind}{struct.calcsize('<' + field.format)}"


def dtype(message_type: type[AnyMessage]) -> np.dtype[np.void]:
    """The structured dtype of a message's body: its fields, packed and little-endian."""
    fields = BY_TYPE[message_type].definition.fields
    return np.dtype([(field.name, _scalar(field)) for field in fields])


def decode_capture(
    data: bytes | bytearray | memoryview, message_type: type[AnyMessage]
) -> NDArray[np.void]:
    """Decode all good frames of one message in a capture.

    Args:
        data: Bytes as they came from the line, with whatever else was on it.
        message_type: The class of the message that is wanted.

    Returns:
        One row a frame, in order; the columns are the fields of `message_type`, see `dtype`. To
        count what was lost, feed the capture to a `Decoder`: all messages share one sequence.
    """
    codec = BY_TYPE[message_type]
    stream = np.frombuffer(data, np.uint8)
    bodies = [np.empty((0, codec.definition.body_size), np.uint8)]
    for starts in _chunk_starts(stream, codec.size + 1):
        payloads, good = _decode_cobs(stream, starts, codec.size)
        good &= payloads[:, 0] == codec.definition.id
        good &= _crc32(payloads) == CRC_RESIDUE
        bodies.append(payloads[good, HEADER_SIZE:-CRC_SIZE])
    return np.concatenate(bodies).view(dtype(message_type)).reshape(-1)


def _chunk_starts(stream: NDArray[np.uint8], length: int) -> Iterator[NDArray[np.intp]]:
    """Where the chunks of `length` bytes between delimiters begin, block by block."""
    last_delimiter = -1
    for begin in range(0, len(stream), _BLOCK_SIZE):
        delimiters = begin + np.flatnonzero(stream[begin : begin + _BLOCK_SIZE] == 0)
        distances = np.diff(delimiters, prepend=last_delimiter)
        starts = delimiters[distances == length + 1] - length
        if len(delimiters):
            last_delimiter = int(delimiters[-1])
        if len(starts):
            yield starts


def _decode_cobs(
    stream: NDArray[np.uint8], starts: NDArray[np.intp], size: int
) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Decode chunks of `size` + 1 bytes: payloads in rows, and which of the chunks are COBS."""
    chunks = np.lib.stride_tricks.sliding_window_view(stream, size + 1)[starts]
    columns = np.ascontiguousarray(chunks.T)
    # Where each row's next code byte is. A code that points beyond column 255 wraps to a column
    # already passed: no further code is found, and the row does not end where a chunk must.
    code_at = np.zeros(len(starts), np.uint8)
    for position, column in enumerate(columns):
        is_code = np.negative((code_at == position).view(np.uint8))
        code = column & is_code
        code_at += code
        column ^= code  # a code byte stands for a zero
    return np.ascontiguousarray(columns[1:].T), code_at == size + 1


@cache
def _crc_table() -> NDArray[np.uint32]:
    """What 16 bits, shifted out of a CRC-32 register, leave in it."""
    table = np.arange(1 << 16, dtype=np.uint32)
    for _ in range(16):
        table = (table >> 1) ^ (table & 1) * np.uint32(_REFLECTED_POLYNOMIAL)
    return table


def _crc32(rows: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """The CRC-32 of each row, two bytes a step."""
    table = _crc_table()
    even = rows.shape[1] // 2 * 2
    register = np.full(len(rows), 0xFFFFFFFF, np.uint32)
    for word in np.ascontiguousarray(rows[:, :even].view("<u2").T):
        register = table.take(register.astype(np.uint16) ^ word) ^ register >> 16
    for byte in rows[:, even:].T:
        register = table[::256].take(register.astype(np.uint8) ^ byte) ^ register >> 8
    return ~register
