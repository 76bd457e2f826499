"""Frames of a board with the self-test image: all messages, and those that only it has."""

from __future__ import annotations

from itertools import count
from typing import Any

from wheelwire_protocol.codec import BY_ID, codec_of
from wheelwire_protocol.framing import SEQ_MODULUS, encode_frame
from wheelwire_protocol.python_decoder import PythonDecoder

from .self_test_types import LAYOUTS

_BY_ID = {**BY_ID, **{layout[0]: codec_of(*layout) for layout in LAYOUTS}}
_BY_TYPE = {codec.type: codec for codec in _BY_ID.values()}


def message_id(message_type: type[Any]) -> int:
    """The id byte of a message class."""
    return _BY_TYPE[message_type].id


class Encoder:
    """As the host's, with the messages of the self-test."""

    def __init__(self) -> None:
        self._numbers = count()

    def encode(self, message: Any) -> bytes:
        """The frame of `message`."""
        return encode_frame(message, next(self._numbers) % SEQ_MODULUS, _BY_TYPE)


def decoder() -> PythonDecoder:
    """A decoder of all these messages."""
    return PythonDecoder(_BY_ID)
