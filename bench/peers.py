"""The codec and its peers, as a program uses them. Needs the extra `bench`."""

from __future__ import annotations

import os
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar
from zlib import crc32

from cobs import cobs
from construct import ConstructError, Int8ul, Int16ul, Struct
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError
from pw_hdlc.decode import FrameDecoder
from pw_hdlc.encode import ui_frame

from wheelwire_protocol import Decoder, Encoder, decode_capture, messages
from wheelwire_protocol.codec import CRC_SIZE
from wheelwire_protocol.framing import CRC_RESIDUE
from wheelwire_protocol.types import WheelState

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import common  # the version is read at import

WHEEL_STATE = messages.WheelState.message


class Peer(ABC):
    """One library: from numbers to bytes, and back from a stream.

    Attributes:
        name: Its name in tables.
        distribution: The package to install.
        remark: What readers must know to judge the row.
        streams: Whether it takes a stream as it arrives, and not only a whole capture.
    """

    name: ClassVar[str]
    distribution: ClassVar[str]
    remark: ClassVar[str]
    streams: ClassVar[bool] = True

    def fields(self, state: WheelState) -> Any:
        """The numbers as `encode` wants them; not part of the time measured."""
        return tuple(state)

    @abstractmethod
    def encode(self, fields: Any) -> bytes:
        """From the numbers to a frame."""

    @abstractmethod
    def decode(self, parts: Sequence[bytes]) -> Sequence[Any]:
        """All messages of a stream that arrives in these parts, in the library's own types."""

    def values(self, decoded: Any) -> tuple[Any, ...]:
        """All numbers of a decoded message: what must be equal to what was sent."""
        return tuple(decoded)


class Streaming(Peer):
    """Typed messages as they arrive, loss counted."""

    name = "**wheelwire, stream**"
    distribution = "wheelwire"
    remark = "CRC-32"

    def __init__(self) -> None:
        self._encoder = Encoder()

    def encode(self, fields: Any) -> bytes:
        return self._encoder.encode(WheelState(*fields))

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        decoder, messages = Decoder(), list[Any]()
        for part in parts:
            messages += decoder.feed(part)
        return messages


class Batch(Streaming):
    """A capture into one structured array."""

    name = "**wheelwire, batch**"
    remark = "a capture into one array"
    streams = False

    def decode(self, parts: Sequence[bytes]) -> Any:
        return decode_capture(b"".join(parts), WheelState)

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(decoded.tolist())


class InCobsFrames(Peer):
    """In COBS frames with a CRC-32, by us: these libraries have no frames.

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


class PigweedHdlc(Peer):
    """Frames with a CRC-32. The meaning of their bytes is left to the user: `struct`."""

    name = "Pigweed pw_hdlc"
    distribution = "pigweed"
    remark = "CRC-32; `struct`"
    _body = struct.Struct(f"<{WHEEL_STATE.body_format}")

    def encode(self, fields: Any) -> bytes:
        return bytes(ui_frame(82, self._body.pack(*fields)))

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        decoder = FrameDecoder()
        return [
            WheelState(*self._body.unpack(frame.data))
            for part in parts
            for frame in decoder.process(part)
            if frame.ok() and len(frame.data) == self._body.size
        ]


class Pymavlink(Peer):
    """MAVLink 2 with its GENERATOR_STATUS, 42 bytes in 11 numbers; the parser is set to go on."""

    name = "pymavlink"
    distribution = "pymavlink"
    remark = "CRC-16; 11 numbers"

    def __init__(self) -> None:
        if common.mcrf4xx is None:
            raise RuntimeError("pymavlink runs without fastcrc, an unfair peer")
        self._sender = common.MAVLink(None, srcSystem=1, srcComponent=1)

    def fields(self, state: WheelState) -> dict[str, Any]:
        return {
            "status": state.boot_id,
            "generator_speed": state.battery_mv,
            "battery_current": state.left_mps,
            "load_current": state.right_mps,
            "power_generated": float(state.command_seq),
            "bus_voltage": float(state.battery_mv),
            "rectifier_temperature": state.left_duty_q15,
            "bat_current_setpoint": float(state.overruns),
            "generator_temperature": state.right_duty_q15,
            "runtime": state.t_us,
            "time_until_maintenance": state.right_ticks,
        }

    def encode(self, fields: Any) -> bytes:
        message = common.MAVLink_generator_status_message(**fields)
        return bytes(message.pack(self._sender))

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        parser = common.MAVLink(None)
        parser.robust_parsing = True
        return [
            message
            for part in parts
            for message in parser.parse_buffer(part) or ()
            if message.get_msgId() >= 0  # below: bytes that were no frame
        ]

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(decoded.to_dict().values())


OURS: tuple[type[Peer], ...] = (Batch, Streaming)
THEIRS: tuple[type[Peer], ...] = (
    ProtobufOverCobs,
    Pymavlink,
    PigweedHdlc,
    CompiledConstruct,
    PlainConstruct,
)
