"""Bulk decoding of captures: all frames of one message, as a numpy structured array.

The result has the same frames as `decoder.Decoder` finds, however damaged the capture is. Where the
firmware's decoder is missing, numpy alone decodes: all frames of one message have the same length,
so the chunks of that length form a table, and each step of the decoding works on a whole column.
"""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray

from . import native
from .codec import BY_TYPE, CRC_SIZE, HEADER_SIZE, Codec
from .framing import CRC_RESIDUE, DELIMITER, MAX_ENCODED
from .types import AnyMessage

_BLOCK_SIZE = 1 << 19
"""Bytes of a capture decoded at once: enough to outweigh the calls, few enough for the cache."""

_REFLECTED_POLYNOMIAL = 0xEDB88320
"""CRC-32's 0x04C11DB7 with its bits in reverse."""


def _scalar(letters: str) -> str:
    if letters.endswith("s"):
        # Raw bytes: numpy's own text, S, drops the zeros at the end, which the message has.
        return f"V{letters[:-1]}"
    kind = "f" if letters == "f" else "u" if letters.isupper() else "i"
    return f"<{kind}{struct.calcsize('<' + letters)}"


def dtype(message_type: type[AnyMessage]) -> np.dtype[np.void]:
    """The structured dtype of a message's body: its fields, packed and little-endian.

    A text is raw bytes (`V24`) with the zeros that fill it, as in the message; `tolist()`
    of its column gives `bytes`.
    """
    formats = map(_scalar, BY_TYPE[message_type].field_formats)
    return np.dtype(list(zip(message_type._fields, formats, strict=True)))


def decode_capture(
    data: bytes | bytearray | memoryview, message_type: type[AnyMessage]
) -> NDArray[np.void]:
    """Decode all good frames of one message in a capture.

    Args:
        data: Bytes as received from the line, including noise.
        message_type: Class of the message to decode.

    Returns:
        One row per frame, in order; the columns are the fields of `message_type`, see `dtype`. To
        count what was lost, feed the capture to a `Decoder`: all messages share one sequence.
    """
    codec = BY_TYPE[message_type]
    if not native.is_present():
        return decode_columns(data, codec).view(dtype(message_type)).reshape(-1)
    library = native.load_unlocked()
    stream = np.frombuffer(data, np.uint8)
    # Room for the most frames possible: each takes its payload, a code byte and at least one of
    # its delimiters, since a delimiter may serve two frames.
    rows = np.empty(len(stream) // (codec.size + 2), dtype(message_type))
    count = library.wheelwire_decode_capture(
        stream.ctypes.data_as(ctypes.c_char_p), len(stream), codec.id, rows.ctypes.data
    )
    # In place, to free the unused memory; a slice would hold all of it.
    rows.resize(count, refcheck=False)
    return rows


def iter_capture(
    parts: Iterable[bytes], message_type: type[AnyMessage]
) -> Iterator[NDArray[np.void]]:
    """Decode a capture that is too large for memory, part by part.

    ```python
    with path.open("rb") as file:
        for states in iter_capture(iter(partial(file.read, 1 << 22), b""), WheelState):
            ...
    ```

    Args:
        parts: The capture in order, cut anywhere. Parts of a few megabytes are fastest.
        message_type: Class of the message to decode.

    Yields:
        An array for each part; together they are the rows of `decode_capture`. Between parts
        only the beginning of one frame is held.
    """
    partial = b""
    for part in parts:
        data = partial + part
        # Cut behind a delimiter, so that no frame is split between two arrays.
        end = data.rfind(DELIMITER) + 1
        yield decode_capture(memoryview(data)[:end], message_type)
        # A tail that is too long for a frame is cut, but not so far that it could become one.
        partial = data[max(end, len(data) - MAX_ENCODED - 1) :]


def decode_columns(data: bytes | bytearray | memoryview, codec: Codec) -> NDArray[np.uint8]:
    """The bodies of all good frames of one message in a capture, one per row."""
    stream = np.frombuffer(data, np.uint8)
    bodies = [np.empty((0, codec.size - HEADER_SIZE - CRC_SIZE), np.uint8)]
    for starts in _chunk_starts(stream, codec.size + 1):
        payloads, good = _decode_cobs(stream, starts, codec.size)
        good &= payloads[0] == codec.id
        good &= _crc32(payloads) == CRC_RESIDUE
        rows = np.ascontiguousarray(payloads[HEADER_SIZE:-CRC_SIZE].T)
        # Selecting by a mask copies the rows, which most blocks of a good capture can do without.
        bodies.append(rows if good.all() else rows[good])
    return np.concatenate(bodies)


def _chunk_starts(stream: NDArray[np.uint8], length: int) -> Iterator[NDArray[np.intp]]:
    """The offsets of all chunks of `length` bytes between delimiters, block by block."""
    # As if one stood before the first byte: a capture may begin with a frame whose first delimiter
    # it lacks.
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
    """Decode chunks of `size` + 1 bytes: payloads in columns, and which of the chunks are COBS."""
    chunks = np.lib.stride_tricks.sliding_window_view(stream, size + 1)[starts]
    # One row for each position, contiguous, since each step below works on one position of all.
    chunks = np.ascontiguousarray(chunks.T)
    # Where each chunk's next code byte is. A code that points beyond byte 255 wraps to a byte
    # already passed: no further code is found, and the chunk does not end where it must.
    code_at = np.zeros(len(starts), np.uint8)
    for position, place in enumerate(chunks):
        # A mask: 0xff for the chunks whose next code byte is here, 0 for the others.
        is_code = np.negative((code_at == position).view(np.uint8))
        code = place & is_code
        code_at += code
        place ^= code  # a code byte replaces a zero
    return chunks[1:], code_at == size + 1


@cache
def _crc_table() -> NDArray[np.uint32]:
    """What 16 bits, shifted out of a CRC-32 register, leave in it."""
    table = np.arange(1 << 16, dtype=np.uint32)
    for _ in range(16):
        table = (table >> 1) ^ (table & 1) * np.uint32(_REFLECTED_POLYNOMIAL)
    return table


def _crc32(columns: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """The CRC-32 of each column, two bytes a step: 54 ns for 46 bytes, one a step takes 71."""
    table = _crc_table()
    even = len(columns) // 2 * 2
    register = np.full(columns.shape[1], 0xFFFFFFFF, np.uint32)
    for word in columns[:even:2] | columns[1:even:2].astype(np.uint16) << 8:
        register = table.take(register.astype(np.uint16) ^ word) ^ register >> 16
    for byte in columns[even:]:
        # Entry n * 256 is what the 8 bits of n leave: the zeros below them shift out first.
        register = table[::256].take(register.astype(np.uint8) ^ byte) ^ register >> 8
    return ~register
