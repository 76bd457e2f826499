"""dynamixel-sdk: protocol 2.0, the telemetry as the parameters of a status packet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dynamixel_sdk import COMM_SUCCESS, PacketHandler

from wheelwire_protocol.types import WheelState

from .base import BODY, Peer, SerialStandIn

_ID = 1
_STATUS = 0x55
_PARAMETERS_AT = 9
"""Behind header, reserved byte, id, length, instruction and error."""
_CRC_SIZE = 2
_LENGTH = 2 + BODY.size + _CRC_SIZE
"""A packet's length field: it counts from the instruction on."""


class _Port:
    """The SDK's port, over a stream; all else of it is about baud rates and clocks."""

    is_using = False

    def __init__(self, parts: Sequence[bytes]) -> None:
        self._stream = SerialStandIn(parts)
        self.written = b""

    def readPort(self, length: int) -> bytes:  # noqa: N802
        return self._stream.read(length)

    def isPacketTimeout(self) -> bool:  # noqa: N802
        return self._stream.exhausted

    def clearPort(self) -> None:  # noqa: N802
        self.written = b""

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        self.written = bytes(packet)
        return len(packet)


class DynamixelSdk(Peer):
    """As the answer to a read of 39 bytes; the meaning of the bytes is left to the user."""

    name = "dynamixel-sdk"
    distribution = "dynamixel-sdk"
    remark = "CRC-16; `struct`"

    def __init__(self) -> None:
        self._handler = PacketHandler(2.0)
        self._out = _Port([])

    def encode(self, fields: Any) -> bytes:
        head = [0, 0, 0, 0, _ID, _LENGTH & 0xFF, _LENGTH >> 8, _STATUS, 0]
        packet = [*head, *BODY.pack(*fields), 0, 0]
        if self._handler.txPacket(self._out, packet) != COMM_SUCCESS:
            raise RuntimeError("the SDK did not send the packet")
        self._out.is_using = False
        return self._out.written

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        port, messages = _Port(parts), []
        while not port.isPacketTimeout():
            packet, result = self._handler.rxPacket(port, False)
            if result == COMM_SUCCESS:
                body = bytes(packet[_PARAMETERS_AT : _PARAMETERS_AT + BODY.size])
                if len(body) == BODY.size:
                    messages.append(WheelState(*BODY.unpack(body)))
        return messages
