"""Protocol Buffers and construct, in COBS frames with a CRC-32: what one builds from parts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any
from zlib import crc32

from cobs import cobs
from construct import ConstructError, Int8ul, Int16ul, Struct
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError

from wheelwire_protocol.codec import CRC_SIZE
from wheelwire_protocol.framing import CRC_RESIDUE
from wheelwire_protocol.messages import WHEEL_STATE
from wheelwire_protocol.types import WheelState

from .base import Peer


class InCobsFrames(Peer):
    """Framed by us, for these libraries have no frames.

    Args:
        parse: From a body to a message.
    """

    def __init__(self, parse: Callable[[bytes], Any]) -> None:
        self._parse = parse

    def _framed(self, body: bytes) -> bytes:
        payload = body + crc32(body).to_bytes(CRC_SIZE, "little")
        return b"\x00" + bytes(cobs.encode(payload)) + b"\x00"

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        parse, messages, partial = self._parse, [], b""
        for part in parts:
            *chunks, partial = (partial + part).split(b"\x00")
            for chunk in filter(None, chunks):
                try:
                    payload = cobs.decode(chunk)
                    if crc32(payload) == CRC_RESIDUE:
                        messages.append(parse(payload[:-CRC_SIZE]))
                except (cobs.DecodeError, ConstructError, DecodeError):  # noqa: PERF203
                    continue
        return messages


_KINDS = descriptor_pb2.FieldDescriptorProto
_TYPES = {"f": _KINDS.TYPE_FLOAT, "l": _KINDS.TYPE_SINT32, "h": _KINDS.TYPE_SINT32}
"""By `struct` format; all others are unsigned and of 32 bits at most."""


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


class ProtobufOverCobs(InCobsFrames):
    """Protocol Buffers."""

    name = "protobuf over COBS"
    distribution = "protobuf"
    remark = "frames and CRC-32 by the bench"

    def __init__(self) -> None:
        self._class = _message_class()
        super().__init__(self._class.FromString)

    def fields(self, state: WheelState) -> dict[str, Any]:
        return state._asdict()

    def encode(self, fields: Any) -> bytes:
        return self._framed(self._class(**fields).SerializeToString())

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(getattr(decoded, field.name) for field in WHEEL_STATE.fields)


class PlainConstruct(InCobsFrames):
    """What a user would write with only construct: our frames, without our fast path."""

    name = "construct"
    distribution = "construct"
    remark = "our frames"
    _layout = Struct("id" / Int8ul, "seq" / Int16ul, "body" / WHEEL_STATE.body)

    def __init__(self) -> None:
        super().__init__(self._layout.parse)

    def fields(self, state: WheelState) -> dict[str, Any]:
        return {"id": WHEEL_STATE.id, "seq": 0, "body": state._asdict()}

    def encode(self, fields: Any) -> bytes:
        return self._framed(self._layout.build(fields))

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(decoded.body[field.name] for field in WHEEL_STATE.fields)


class CompiledConstruct(PlainConstruct):
    """The same after `Struct.compile()`."""

    name = "construct, compiled"
    _layout = PlainConstruct._layout.compile()
