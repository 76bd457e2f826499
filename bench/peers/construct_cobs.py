"""construct, plain and compiled, in the place of our fast path: same frames, same CRC."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cobs import cobs
from construct import ConstructError, Int8ul, Int16ul, Int32ul, Struct

from wheelwire_protocol.codec import CRC_SIZE
from wheelwire_protocol.framing import CRC_RESIDUE
from wheelwire_protocol.messages import WHEEL_STATE
from wheelwire_protocol.reference import crc32
from wheelwire_protocol.types import WheelState

from .base import Peer

_HEAD = Struct("id" / Int8ul, "seq" / Int16ul, "body" / WHEEL_STATE.body)
_PAYLOAD = Struct(*_HEAD.subcons, "crc" / Int32ul)


class PlainConstruct(Peer):
    """What a user would write with only construct."""

    name = "construct"
    distribution = "construct"
    remark = "our frames; CRC by crcmod"

    def __init__(self) -> None:
        self._head, self._payload = self._layouts()

    def _layouts(self) -> tuple[Any, Any]:
        return _HEAD, _PAYLOAD

    def fields(self, state: WheelState) -> dict[str, Any]:
        return {"id": WHEEL_STATE.id, "seq": 0, "body": state._asdict()}

    def encode(self, fields: Any) -> bytes:
        head = self._head.build(fields)
        payload = head + crc32(head).to_bytes(CRC_SIZE, "little")
        return b"\x00" + bytes(cobs.encode(payload)) + b"\x00"

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        messages, partial = [], b""
        for part in parts:
            *chunks, partial = (partial + part).split(b"\x00")
            for chunk in filter(None, chunks):
                try:
                    payload = cobs.decode(chunk)
                    if crc32(payload) == CRC_RESIDUE:
                        messages.append(self._payload.parse(payload))
                except (cobs.DecodeError, ConstructError):  # noqa: PERF203
                    continue
        return messages

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(decoded.body[field.name] for field in WHEEL_STATE.fields)


class CompiledConstruct(PlainConstruct):
    """The same after `Struct.compile()`."""

    name = "construct, compiled"

    def _layouts(self) -> tuple[Any, Any]:
        return _HEAD.compile(), _PAYLOAD.compile()
