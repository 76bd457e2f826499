"""Bulk decoding of captures: all frames of one message, as a numpy structured array.

The result has the same frames as `decoder.Decoder` finds, however damaged the capture is.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from . import native
from .codec import BY_TYPE
from .columns import decode_columns
from .framing import DELIMITER, MAX_ENCODED
from .types import AnyMessage


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
        stream.ctypes.data, len(stream), codec.id, rows.ctypes.data
    )
    # In place, which gives the unused memory back; a slice would keep all of it.
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
        An array for each part; together they are the rows of `decode_capture`. Only the beginning
        of one frame is kept between parts.
    """
    partial = b""
    for part in parts:
        data = partial + part
        # Cut behind a delimiter, so that no frame is split between two arrays.
        end = data.rfind(DELIMITER) + 1
        yield decode_capture(memoryview(data)[:end], message_type)
        # A tail that is too long for a frame is cut, but not so far that it could become one.
        partial = data[max(end, len(data) - MAX_ENCODED - 1) :]
