"""An ESP32's ROM loader, esptool's stub and the bootloader before 4 MB of flash. Sans-IO.

esptool speaks to it as to a chip; what boots from its flash is a `CoreDevice`. A pseudo-terminal
has no modem lines: SLIP's SYNC resets the chip into its loader, other bytes reset it out of it.

The protocol is described in esptool's documentation, "Serial Protocol".
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from operator import xor

from .core_device import CoreDevice

FLASH_BYTES = 4 << 20
SECTOR = 0x1000
TABLE_OFFSET = 0x8000
OTADATA_ENTRY = struct.Struct("<I20sII")  # sequence, label, state, CRC of the sequence
IMAGE_MAGIC = 0xE9

_END = 0xC0
_SYNC = b"\xc0\x00\x08"
_INVALID = b"\x01\x05"
_STATUS_BYTES = {False: 4, True: 2}  # of the ROM, of the stub
_CHIP_DETECT = 0x40001000
_ESP32_MAGIC = 0x00F01D83
_UART_CLOCK_DIVIDER = 0x3FF40014
_SPI_DATA = (0x3FF42080, 0x60002058, 0x60003058)
_WINBOND = 0x40EF


@dataclass(frozen=True)
class ChipKind:
    """How a chip is identified: newer ones report an id, the ESP32 has a word in its ROM."""

    bootloader: int
    chip_id: int


ESP32 = ChipKind(0x1000, 0)
ESP32S3 = ChipKind(0, 9)
ESP32C6 = ChipKind(0, 13)
ESP32C3 = ChipKind(0, 5)


class EspChip:
    """`flash` may be changed between sessions; `erased` lists the erased ranges in order."""

    def __init__(self, kind: ChipKind = ESP32, device: CoreDevice | None = None) -> None:
        self.kind = kind
        self.device = device or CoreDevice()
        self.flash = bytearray(b"\xff" * FLASH_BYTES)
        self.erased: list[tuple[int, int]] = []
        self.flash_id = FLASH_BYTES.bit_length() - 1 << 16 | _WINBOND
        """What the flash says of itself: its size, as a power of two, and who made it."""
        self.answers_loader = True
        """False: BOOT is not pressed."""
        self._loading = False
        self._stub = False
        self._frame: bytearray | None = None
        self._output = bytearray()
        self._read: tuple[bytes, int] | None = None
        self._write_at = 0
        self._write_end = 0
        self._inflate = zlib.decompressobj()
        nothing_to_do = (0x04, 0x05, 0x06, 0x07, 0x09, 0x0B, 0x0D, 0x0F, 0x12)
        self._commands: dict[int, Callable[[bytes], bytes]] = {
            **dict.fromkeys(nothing_to_do, lambda _: b""),
            0x02: self._begin,
            0x03: lambda body: self._program(body[16:]),
            0x10: self._begin,
            0x11: lambda body: self._program(self._inflate.decompress(body[16:])),
            0x13: self._digest,
            0xD0: lambda _: self._erase(0, FLASH_BYTES),
            0xD1: lambda body: self._erase(*struct.unpack("<II", body)),
            0xD2: self._begin_read,
        }

    def boots(self) -> bool:
        """Whether bootloader, table and the application that otadata selects are in place."""
        starts = [self.kind.bootloader, self.application()]
        return None not in starts and all(self.flash[at or 0] == IMAGE_MAGIC for at in starts)

    # --- the line -------------------------------------------------------------------------------

    def feed(self, data: bytes, now_us: int) -> None:
        """Receive bytes from the line."""
        if self._loading and data[0] != _END and self._frame is None:
            self._loading = False
            self.device.reset()
        elif not self._loading and _SYNC in data and self.answers_loader:
            self._loading = True
            self._stub = False
            self.device.reset()
            data = data[data.index(_SYNC) :]
        if self._loading:
            self._take_slip(data)
        elif self.boots():
            self.device.feed(data, now_us)

    def advance(self, now_us: int) -> None:
        """Let the firmware run, if it does."""
        if not self._loading:
            self.device.advance(now_us)

    def take_output(self) -> bytes:
        """Take the bytes for the line."""
        output = bytes(self._output) if self._loading else self.device.take_output()
        self._output.clear()
        return output

    def _take_slip(self, data: bytes) -> None:
        for byte in data:
            if byte == _END:
                if self._frame:
                    packet = bytes(self._frame).replace(b"\xdb\xdc", b"\xc0")
                    self._take_packet(packet.replace(b"\xdb\xdd", b"\xdb"))
                    self._frame = None
                else:
                    self._frame = bytearray()
            elif self._frame is not None:
                self._frame.append(byte)

    def _send(self, packet: bytes) -> None:
        escaped = packet.replace(b"\xdb", b"\xdb\xdd").replace(b"\xc0", b"\xdb\xdc")
        self._output += b"\xc0" + escaped + b"\xc0"

    def _reply(self, op: int, data: bytes = b"", value: int = 0, status: bytes = b"\0\0") -> None:
        data += status.ljust(_STATUS_BYTES[self._stub], b"\0")
        self._send(struct.pack("<BBHI", 1, op, len(data), value) + data)

    # --- the loader's commands ------------------------------------------------------------------

    def _take_packet(self, packet: bytes) -> None:
        if self._read:
            self._continue_read(struct.unpack("<I", packet)[0])
            return
        _, op, _, checksum = struct.unpack_from("<BBHI", packet)
        body = packet[8:]
        if op in (0x03, 0x07, 0x11) and checksum != reduce(xor, body[16:], 0xEF):
            self._reply(op, status=b"\x01\x07")
        elif op == 0x08:
            for _ in range(8):
                self._reply(op, value=0 if self._stub else 0x20120707)
        elif op == 0x0A:
            self._reply(op, value=self._register(struct.unpack("<I", body)[0]))
        elif op == 0x14 and self.kind.chip_id:
            self._reply(op, struct.pack("<I8xII", 0, self.kind.chip_id, 0))
        elif op in self._commands:
            self._reply(op, self._commands[op](body))
            if op == 0x06:
                self._stub = True
                self._send(b"OHAI")
            elif self._read:
                self._continue_read(0)
        else:
            self._reply(0, status=_INVALID)

    def _register(self, address: int) -> int:
        if address == _CHIP_DETECT:
            return 0 if self.kind.chip_id else _ESP32_MAGIC
        if address == _UART_CLOCK_DIVIDER:
            return 40_000_000 // 115_200
        return self.flash_id if address in _SPI_DATA else 0

    def _begin(self, body: bytes) -> bytes:
        size, _, _, offset = struct.unpack_from("<IIII", body)
        self._inflate = zlib.decompressobj()
        self._write_at, self._write_end = offset, offset + size
        if size:
            start = offset // SECTOR * SECTOR
            self._erase(start, -(-(offset + size) // SECTOR) * SECTOR - start)
        return b""

    def _program(self, data: bytes) -> bytes:
        """Write flash, which can only clear bits: data on flash that was not erased is corrupted.

        The last block is padded; bytes beyond the announced size are not written.
        """
        data = data[: self._write_end - self._write_at]
        for index, byte in enumerate(data, self._write_at):
            self.flash[index] &= byte
        self._write_at += len(data)
        return b""

    def _erase(self, offset: int, size: int) -> bytes:
        assert offset % SECTOR == 0, "no sector begins there"
        assert size % SECTOR == 0, "no sector ends there"
        self.flash[offset : offset + size] = b"\xff" * size
        self.erased.append((offset, offset + size))
        return b""

    def _digest(self, body: bytes) -> bytes:
        offset, size = struct.unpack_from("<II", body)
        return hashlib.md5(self.flash[offset : offset + size], usedforsecurity=False).digest()

    def _begin_read(self, body: bytes) -> bytes:
        offset, size = struct.unpack_from("<II", body)
        self._read = bytes(self.flash[offset : offset + size]), 0
        return b""

    def _continue_read(self, acknowledged: int) -> None:
        """A sector at a time, each acknowledged by how much has come; a digest ends it."""
        assert self._read is not None
        content, sent = self._read
        assert acknowledged == sent
        block = content[sent : sent + SECTOR]
        if block:
            self._send(block)
            self._read = content, sent + len(block)
            return
        self._send(hashlib.md5(content, usedforsecurity=False).digest())
        self._read = None

    # --- the bootloader -------------------------------------------------------------------------

    def application(self) -> int | None:
        """Where the application begins that the second-stage bootloader would start."""
        apps: dict[int, int] = {}
        otadata = None
        for at in range(TABLE_OFFSET, TABLE_OFFSET + 0xC00, 32):
            magic, kind, subtype, offset, _ = struct.unpack_from("<HBBII", self.flash, at)
            if magic == 0xEBEB:
                digest = hashlib.md5(self.flash[TABLE_OFFSET:at], usedforsecurity=False).digest()
                if digest != self.flash[at + 16 : at + 32]:
                    return None
            if magic != 0x50AA:
                break
            if kind == 0:
                apps[subtype] = offset
            elif (kind, subtype) == (1, 0):
                otadata = offset
        slots = [apps[subtype] for subtype in sorted(apps) if 0x10 <= subtype < 0x20]
        newest = 0 if otadata is None else max(self._sequence(otadata + i * SECTOR) for i in (0, 1))
        if newest and slots:
            return slots[(newest - 1) % len(slots)]
        return apps.get(0, slots[0] if slots else None)

    def _sequence(self, at: int) -> int:
        sequence, _, _, crc = OTADATA_ENTRY.unpack_from(self.flash, at)
        expected = zlib.crc32(struct.pack("<I", sequence), 0xFFFFFFFF)
        return sequence if sequence != 0xFFFFFFFF and crc == expected else 0
