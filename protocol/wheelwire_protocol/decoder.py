"""`Decoder`: decodes bytes to typed messages with the firmware's own decoder.

If the firmware's library is missing it is the one in Python: same messages and counts, but slower.
"""

from __future__ import annotations

import ctypes
import struct
from itertools import repeat
from typing import TYPE_CHECKING, Any

from . import core_abi as abi
from . import native
from .codec import BY_ID
from .framing import Counters
from .types import AnyMessage

_PART_SIZE = 1 << 12
"""The most bytes decoded per call: enough to outweigh the cost of the call."""

# The spare room is for the beginning of a frame that was fed before.
_Bodies = ctypes.c_uint8 * (_PART_SIZE + abi.SPARE_ROOM)
_Runs = abi.Run * (_PART_SIZE // abi.LEAST_FRAME + 1)

_NEW: Any = tuple.__new__
"""Creates a message from its class and the tuple of its fields, faster than calling the class."""

_BODIES = {
    codec.id: (codec.type, body.size, body.unpack_from, body.iter_unpack)
    for codec in BY_ID.values()
    for body in (struct.Struct(f"<{codec.formats}"),)
}


class NativeDecoder:
    """Decodes bytes, cut anywhere, to typed messages with the firmware's decoder.

    Not thread-safe.

    Raises:
        NativeMissingError: The library is missing or of another release.
        MemoryError: Out of memory.
    """

    def __init__(self) -> None:
        library = native.load()
        # Looked up once, as `feed` runs for every read of the port.
        self._feed = library.wheelwire_decoder_feed
        self._library = library
        bodies, runs = _Bodies(), _Runs()
        # The views keep the library's buffers alive. They are cast to bytes first, because a view
        # in ctypes' own format cannot be indexed or cast to another number type.
        self._bodies = memoryview(bodies).cast("B")
        self._runs = memoryview(runs).cast("B").cast("I")
        self._handle = library.wheelwire_decoder_create(ctypes.addressof(bodies), runs)
        if not self._handle:
            raise MemoryError("no memory for a decoder")

    def __del__(self) -> None:
        # The attribute is missing if loading the library failed.
        if getattr(self, "_handle", None):
            self._library.wheelwire_decoder_destroy(self._handle)

    def feed(self, data: bytes) -> list[AnyMessage]:
        """Decode what has arrived.

        Args:
            data: Any number of bytes, cut anywhere.

        Returns:
            The messages of the frames that were completed by `data`, in order.
        """
        size = len(data)
        if size > _PART_SIZE or type(data) is not bytes:
            # The buffers have room for one part, and ctypes takes nothing but bytes for a char*.
            return self._feed_in_parts(memoryview(data))
        count = self._feed(self._handle, data, size)
        if count == 0:
            return []
        # `runs` has pairs (message id, number of frames); the bodies lie one after the other.
        # Nearly every call finds one frame, or several of one message: these cases come first.
        runs, bodies = self._runs, self._bodies
        message_type, body_size, unpack, iter_unpack = _BODIES[runs[0]]
        frames = runs[1]
        if frames == 1:
            messages = [_NEW(message_type, unpack(bodies))]
        else:
            fields = iter_unpack(bodies[: frames * body_size])
            messages = list(map(_NEW, repeat(message_type), fields))
        at = frames * body_size
        for run in range(2, 2 * count, 2):
            message_type, body_size, unpack, iter_unpack = _BODIES[runs[run]]
            end = at + runs[run + 1] * body_size
            messages += map(_NEW, repeat(message_type), iter_unpack(bodies[at:end]))
            at = end
        return messages

    def restart_sequence(self) -> None:
        """Accept any sequence number next, because the sender has restarted."""
        self._library.wheelwire_decoder_restart_sequence(self._handle)

    def restart(self) -> None:
        """Forget a partial frame and the sequence: the line was reopened. Keeps the counters."""
        self._library.wheelwire_decoder_restart(self._handle)

    @property
    def counters(self) -> Counters:
        """What it has seen so far."""
        raw = self._counted()
        return Counters(*(getattr(raw, field[0]) for field in raw._fields_))

    @property
    def seq_lost(self) -> int:
        """As `counters.seq_lost`, without the others."""
        return int(self._counted().seq_lost)

    def _counted(self) -> abi.Counters:
        raw = abi.Counters()
        self._library.wheelwire_decoder_counters(self._handle, ctypes.byref(raw))
        return raw

    def _feed_in_parts(self, data: memoryview) -> list[AnyMessage]:
        messages: list[AnyMessage] = []
        for at in range(0, len(data), _PART_SIZE):
            messages += self.feed(bytes(data[at : at + _PART_SIZE]))
        return messages


# Type checkers see one class: both have the same methods.
if TYPE_CHECKING or native.is_present():
    Decoder = NativeDecoder
else:
    from .python_decoder import PythonDecoder

    Decoder = PythonDecoder
