"""Protocol Buffers in COBS frames with a CRC-32: what one builds from parts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from zlib import crc32

from cobs import cobs
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError

from wheelwire_protocol.messages import WHEEL_STATE
from wheelwire_protocol.types import WheelState

from .base import Peer

_KINDS = descriptor_pb2.FieldDescriptorProto
_TYPES = {"f": _KINDS.TYPE_FLOAT, "l": _KINDS.TYPE_SINT32, "h": _KINDS.TYPE_SINT32}
"""By `struct` format; all others are unsigned and of 32 bits at most."""
_CRC_SIZE = 4


def _message_class() -> Any:
    """The class that protoc would make of a .proto with WheelState's fields."""
    file = descriptor_pb2.FileDescriptorProto(name="wheel_state.proto", syntax="proto3")
    message = file.message_type.add(name="WheelState")
    for number, field in enumerate(WHEEL_STATE.fields, 1):
        kind = _TYPES.get(field.format, _KINDS.TYPE_UINT32)
        message.field.add(name=field.name, number=number, type=kind, label=_KINDS.LABEL_OPTIONAL)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("WheelState"))


class ProtobufOverCobs(Peer):
    """Framed by us, for protobuf has no frames: a delimiter, COBS, CRC-32."""

    name = "protobuf over COBS"
    distribution = "protobuf"
    remark = "frames and CRC-32 by the bench"

    def __init__(self) -> None:
        self._class = _message_class()

    def fields(self, state: WheelState) -> dict[str, Any]:
        return state._asdict()

    def encode(self, fields: Any) -> bytes:
        body = self._class(**fields).SerializeToString()
        payload = body + crc32(body).to_bytes(_CRC_SIZE, "little")
        return b"\x00" + bytes(cobs.encode(payload)) + b"\x00"

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        parse, messages, partial = self._class.FromString, [], b""
        for part in parts:
            *chunks, partial = (partial + part).split(b"\x00")
            for chunk in filter(None, chunks):
                try:
                    payload = cobs.decode(chunk)
                    body, crc = payload[:-_CRC_SIZE], payload[-_CRC_SIZE:]
                    if crc32(body).to_bytes(_CRC_SIZE, "little") == crc:
                        messages.append(parse(body))
                except (cobs.DecodeError, DecodeError):  # noqa: PERF203
                    continue
        return messages

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(getattr(decoded, field.name) for field in WHEEL_STATE.fields)
