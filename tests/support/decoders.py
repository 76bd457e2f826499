"""The firmware's decoder and the one in Python, for comparison."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from wheelwire_protocol.codec import BY_TYPE
from wheelwire_protocol.decoder import NativeDecoder
from wheelwire_protocol.framing import Counters
from wheelwire_protocol.python_decoder import PythonDecoder
from wheelwire_protocol.types import AnyMessage


class Decoded(NamedTuple):
    """The result of decoding a line's bytes.

    The messages are packed again, because a NaN is not equal to itself.
    """

    messages: list[bytes]
    counters: Counters


def by_firmware(pieces: Iterable[bytes]) -> Decoded:
    """Feed the pieces of a line's bytes to the firmware's decoder."""
    return _decoded(NativeDecoder(), pieces)


def by_python(pieces: Iterable[bytes]) -> Decoded:
    """Feed the pieces of a line's bytes to the decoder in Python."""
    return _decoded(PythonDecoder(), pieces)


def _decoded(decoder: NativeDecoder | PythonDecoder, pieces: Iterable[bytes]) -> Decoded:
    messages = [message for piece in pieces for message in decoder.feed(piece)]
    return Decoded([_packed(message) for message in messages], decoder.counters)


def _packed(message: AnyMessage) -> bytes:
    codec = BY_TYPE[type(message)]
    return bytes([codec.id]) + codec.pack_body(*message)
