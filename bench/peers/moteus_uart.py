"""moteus: a query's answer in lines of hexadecimal text, as its serial port brings it."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Sequence
from typing import Any
from unittest.mock import patch

import moteus
from moteus.protocol import parse_message

from wheelwire_protocol.types import WheelState

from .base import Peer

_REPLY_INT8, _REPLY_INT32 = 0x20, 0x28
_LAYOUT = struct.Struct("<BBB8i BB3b 8x")
"""Registers 1 to 8 as int32, 13 to 15 as int8: 11 numbers in 40 bytes, 48 on CAN FD."""


class _Port:
    """The library's serial port, over a stream."""

    def __init__(self, parts: Sequence[bytes]) -> None:
        self._parts = iter(parts)

    def close(self) -> None:
        """There is nothing to close."""

    async def read(self, _size: int, block: bool = True) -> bytes:
        del block
        part = next(self._parts, None)
        if part is None:
            raise EOFError
        return part


def _crc8(data: bytes) -> int:
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc << 1 ^ (0x197 if crc & 0x80 else 0)
    return crc


class Moteus(Peer):
    """The library writes commands only, so its telemetry is written here."""

    name = "moteus"
    distribution = "moteus"
    remark = "CRC-8; 11 numbers"
    encodes = False

    def __init__(self) -> None:
        self._loop = asyncio.new_event_loop()

    def encode(self, fields: Any) -> bytes:
        state = WheelState(*fields)
        data = _LAYOUT.pack(
            *(_REPLY_INT32, 8, 1),
            *(state.t_us, state.left_ticks, state.right_ticks),
            *(state.left_duty_q15, state.right_duty_q15, state.command_seq),
            *(state.battery_mv, state.overruns),
            *(_REPLY_INT8 | 3, 13, state.supervisor, state.faults, 0),
        )
        line = f"rcv 0100 {data.hex().upper()} B F ".encode()
        return line + b"*%02X\r\n" % _crc8(line)

    def decode(self, parts: Sequence[bytes]) -> list[Any]:
        frames = self._loop.run_until_complete(self._frames(parts))
        return [parse_message(frame) for frame in frames]

    async def _frames(self, parts: Sequence[bytes]) -> Sequence[Any]:
        with patch("moteus.fdcanusb_device.aioserial.AioSerial", lambda **_: _Port(parts)):
            device = moteus.FdcanusbDevice(max_buffer_size=1 << 30)
        # The library's reading task ends at a line that it cannot parse: its step is taken here.
        device.close()
        while True:
            try:
                await device._process_one_line()
            except EOFError:  # noqa: PERF203
                return list(device._receive_queue)
            except (RuntimeError, ValueError, IndexError):
                continue

    def values(self, decoded: Any) -> tuple[Any, ...]:
        return tuple(decoded.values.items())
