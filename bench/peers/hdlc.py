"""Pigweed's HDLC: frames with a CRC-32, and bytes inside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pw_hdlc.decode import FrameDecoder
from pw_hdlc.encode import ui_frame

from wheelwire_protocol.types import WheelState

from .base import BODY, Peer

_ADDRESS = 82


class PigweedHdlc(Peer):
    """The meaning of the bytes is left to the user: `struct`, into our own type."""

    name = "Pigweed pw_hdlc"
    distribution = "pigweed"
    remark = "CRC-32; `struct`"

    def encode(self, fields: Any) -> bytes:
        return bytes(ui_frame(_ADDRESS, BODY.pack(*fields)))

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        decoder = FrameDecoder()
        return [
            WheelState(*BODY.unpack(frame.data))
            for part in parts
            for frame in decoder.process(part)
            if frame.ok() and len(frame.data) == BODY.size
        ]
