"""The firmware's decoder and the host's, so that one can be held to the other."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import fields
from functools import cache
from typing import NamedTuple

from wheelwire_protocol.codec import BY_ID, BY_TYPE
from wheelwire_protocol.framing import Counters, Decoder
from wheelwire_protocol.payload import CRC_SIZE, HEADER_SIZE
from wheelwire_protocol.types import AnyMessage

from .fwsim import BUILD

LIBRARY = BUILD / "libwheelwire-decoder.so"
_COUNTERS = ctypes.c_uint32 * len(fields(Counters))


class Decoded(NamedTuple):
    """What a decoder made of a line's bytes.

    Messages are packed again, for a NaN is not equal to itself.
    """

    messages: list[bytes]
    counters: Counters


def by_firmware(data: bytes) -> Decoded:
    """Feed `data` to the firmware's decoder."""
    out = ctypes.create_string_buffer(len(data) + 1)
    counted = _COUNTERS()
    size = _library().wheelwire_decode(data, len(data), out, counted)
    return Decoded([_packed(message) for message in _split(out.raw[:size])], Counters(*counted))


def count_by_firmware(data: bytes, out: ctypes.Array[ctypes.c_char]) -> int:
    """Feed `data` to the firmware's decoder, all frames to `out`; returns how many there were."""
    counted = _COUNTERS()
    _library().wheelwire_decode(data, len(data), out, counted)
    return Counters(*counted).frames


def by_host(pieces: Iterable[bytes]) -> Decoded:
    """Feed the pieces of a line's bytes to the host's decoder."""
    decoder = Decoder()
    messages = [message for piece in pieces for message in decoder.feed(piece)]
    return Decoded([_packed(message) for message in messages], decoder.counters)


@cache
def _library() -> ctypes.CDLL:
    library = ctypes.CDLL(str(LIBRARY))
    library.wheelwire_decode.restype = ctypes.c_size_t
    library.wheelwire_decode.argtypes = (
        ctypes.c_char_p,
        ctypes.c_size_t,
        ctypes.c_char_p,
        _COUNTERS,
    )
    return library


def _split(records: bytes) -> Iterable[AnyMessage]:
    at = 0
    while at < len(records):
        codec = BY_ID[records[at]]
        end = at + 1 + codec.size - HEADER_SIZE - CRC_SIZE
        yield codec.type(
            *codec.unpack(bytes(HEADER_SIZE) + records[at + 1 : end] + bytes(CRC_SIZE))
        )
        at = end


def _packed(message: AnyMessage) -> bytes:
    codec = BY_TYPE[type(message)]
    return codec.pack(codec.id, 0, *message)
