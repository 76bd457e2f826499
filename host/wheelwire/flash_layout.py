"""What lies where in a chip's flash: partition tables, an image's parts, what writing it does.

Formats: "Partition Tables" and "App Image Format" in ESP-IDF's documentation.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wheelwire_protocol.codes import Board

from .errors import FlashFailed

TABLE_OFFSET = 0x8000
TABLE_BYTES = 0xC00
SECTOR = 0x1000
ERASED = b"\xff"

_IMAGE_MAGIC = 0xE9
_CHIP_ID_OFFSET = 12
_BOOTLOADERS = {0x1000: {0: Board.ESP32}, 0: {9: Board.ESP32S3, 13: Board.ESP32C6}}
"""Where a chip's bootloader begins, and the chip ids that its header may hold there."""
_ENTRY = struct.Struct("<2sBBII16sI")
_ENTRY_MAGIC = b"\xaa\x50"
_DIGEST_MAGIC = b"\xeb\xeb"
_APPLICATION = 0
_OTADATA = (1, 0)


@dataclass(frozen=True)
class Partition:
    """One line of a partition table; offset and size in bytes."""

    name: str
    kind: int
    subtype: int
    offset: int
    size: int

    @property
    def end(self) -> int:
        """The first byte behind it."""
        return self.offset + self.size

    @property
    def holds_data(self) -> bool:
        """Whether it belongs to the firmware or its user, and not to the image."""
        return self.kind != _APPLICATION and (self.kind, self.subtype) != _OTADATA


@dataclass(frozen=True)
class Part:
    """Bytes that have their place in flash."""

    name: str
    offset: int
    content: bytes

    @property
    def end(self) -> int:
        """The first byte behind it."""
        return self.offset + len(self.content)


@dataclass(frozen=True)
class Image:
    """A merged image, taken apart: what is written, and the table that says what is not."""

    path: Path
    board: Board
    parts: tuple[Part, ...]
    table: tuple[Partition, ...]


@dataclass(frozen=True)
class Plan:
    """What flashing does to a chip.

    Attributes:
        writes: In the order of their places. A region that is erased is written with 0xff.
        kept: Names of the data partitions of which the chip keeps what it has.
        erased: The regions of data partitions that held something else, as parts of 0xff.
        reason: Why they are erased; empty when none is.
        erase_all: The whole flash is erased first.
    """

    writes: tuple[Part, ...]
    kept: tuple[str, ...] = ()
    erased: tuple[Part, ...] = ()
    reason: str = ""
    erase_all: bool = False


def parse_table(raw: bytes) -> tuple[Partition, ...]:
    """The partitions of a table; none when it is no table, or a damaged one."""
    found: list[Partition] = []
    for at in range(0, min(len(raw), TABLE_BYTES) - _ENTRY.size + 1, _ENTRY.size):
        magic, kind, subtype, offset, size, name, _ = _ENTRY.unpack_from(raw, at)
        if magic == _ENTRY_MAGIC:
            label = name.split(b"\0")[0].decode("ascii", "replace")
            found.append(Partition(label, kind, subtype, offset, size))
            continue
        if magic == _DIGEST_MAGIC:
            digest = hashlib.md5(raw[:at], usedforsecurity=False).digest()
            if digest != raw[at + 16 : at + 32]:
                return ()
        break
    return tuple(found)


def read_image(path: Path) -> Image:
    """Take a merged image apart.

    Raises:
        FlashFailed: There is no such file, or it is no image for a chip that Wheelwire runs on.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FlashFailed(f"cannot read the image {path}: {error.strerror}") from error
    table = parse_table(content[TABLE_OFFSET : TABLE_OFFSET + TABLE_BYTES])
    parts = [_application(content, partition) for partition in table]
    applications = [part for part in parts if part]
    bootloader = _bootloader_of(content)
    if not applications or bootloader is None:
        raise FlashFailed(
            f"{path} is not a Wheelwire firmware image for a supported chip; "
            "use wheelwire-<board>.bin from a release"
        )
    board, start = bootloader
    otadata = [
        Part(p.name, p.offset, ERASED * p.size) for p in table if (p.kind, p.subtype) == _OTADATA
    ]
    return Image(
        path,
        board,
        (
            Part("bootloader", start, content[start:TABLE_OFFSET].rstrip(ERASED)),
            Part("partition table", TABLE_OFFSET, content[TABLE_OFFSET:][:TABLE_BYTES]),
            *otadata,
            *applications,
        ),
        table,
    )


def plan_flash(image: Image, chip_table: Sequence[Partition], *, erase_all: bool = False) -> Plan:
    """What writing an image does to a chip with that partition table.

    A data partition stays as it is where the chip has one of its kind at its place. The rest of it
    held something else, such as another firmware's code, which must not be taken for data.
    """
    if erase_all:
        return Plan(_ordered(image.parts), erase_all=True)
    data = [partition for partition in image.table if partition.holds_data]
    kept = {partition.name: _kept_until(partition, chip_table) for partition in data}
    erased = [
        Part(p.name, kept[p.name], ERASED * (p.end - kept[p.name]))
        for p in data
        if kept[p.name] < p.end
    ]
    reason = "another partition table" if chip_table else "no partition table"
    return Plan(
        _ordered((*image.parts, *erased)),
        tuple(p.name for p in data if kept[p.name] > p.offset),
        tuple(erased),
        f"the chip has {reason}" if erased else "",
    )


def _kept_until(partition: Partition, chip_table: Sequence[Partition]) -> int:
    """Up to where the chip's flash holds what belongs into a partition."""
    for on_chip in chip_table:
        same_kind = (on_chip.kind, on_chip.subtype) == (partition.kind, partition.subtype)
        if same_kind and on_chip.offset == partition.offset:
            return min(on_chip.end, partition.end)
    return partition.offset


def _ordered(parts: Sequence[Part]) -> tuple[Part, ...]:
    return tuple(sorted(parts, key=lambda part: part.offset))


def _bootloader_of(content: bytes) -> tuple[Board, int] | None:
    """For which chip an image is, and where its bootloader begins."""
    for offset, boards in _BOOTLOADERS.items():
        header = content[offset : offset + _CHIP_ID_OFFSET + 2]
        chip_id = int.from_bytes(header[_CHIP_ID_OFFSET:], "little")
        if header[:1] == bytes([_IMAGE_MAGIC]) and chip_id in boards:
            return boards[chip_id], offset
    return None


def _application(content: bytes, partition: Partition) -> Part | None:
    """What an image holds for an application's partition."""
    code = content[partition.offset : partition.end]
    if partition.kind != _APPLICATION or code[:1] != bytes([_IMAGE_MAGIC]):
        return None
    return Part(partition.name, partition.offset, code.rstrip(ERASED))
