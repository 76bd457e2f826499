"""The layout of a chip's flash: partition tables, the parts of an image, what to write.

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

# Where ESP-IDF's tools put the table by default, and the most that it takes up there.
TABLE_OFFSET = 0x8000
TABLE_BYTES = 0xC00
SECTOR = 0x1000
ERASED = b"\xff"

_IMAGE_MAGIC = 0xE9
_CHIP_ID_OFFSET = 12
_BOOTLOADERS = {0x1000: {0: Board.ESP32}, 0: {9: Board.ESP32S3, 13: Board.ESP32C6}}
"""Offset of the boot loader, and the chip ids that its header may contain there."""
# Magic, type, subtype, offset, size, label, flags.
_ENTRY = struct.Struct("<2sBBII16sI")
_ENTRY_MAGIC = b"\xaa\x50"
# In place of an entry: 14 bytes of 0xff follow, then the MD5 of all entries before it.
_DIGEST_MAGIC = b"\xeb\xeb"
_APPLICATION = 0
# Type and subtype. It selects the application that the boot loader starts.
_OTADATA = (1, 0)


@dataclass(frozen=True)
class Partition:
    """One entry of a partition table; offset and size in bytes."""

    name: str
    kind: int
    subtype: int
    offset: int
    size: int

    @property
    def end(self) -> int:
        """Offset of the first byte after it."""
        return self.offset + self.size

    @property
    def holds_data(self) -> bool:
        """Whether it holds data of the user or the firmware, rather than a part of the image."""
        # Neither code nor otadata, which has to select the code that is written.
        return self.kind != _APPLICATION and (self.kind, self.subtype) != _OTADATA


@dataclass(frozen=True)
class Part:
    """Bytes and their offset in flash."""

    name: str
    offset: int
    content: bytes

    @property
    def end(self) -> int:
        """Offset of the first byte after it."""
        return self.offset + len(self.content)


@dataclass(frozen=True)
class Image:
    """A merged image, split into the parts to write, and its partition table."""

    path: Path
    board: Board
    parts: tuple[Part, ...]
    table: tuple[Partition, ...]


@dataclass(frozen=True)
class Plan:
    """What flashing does to a chip.

    Attributes:
        writes: In order of their offsets. A region is erased by writing 0xff.
        kept: Names of the data partitions whose content stays on the chip.
        erased: The regions of data partitions with foreign content, as parts of 0xff.
        reason: Why they are erased; empty if none is.
        erase_all: The whole flash is erased first.
    """

    writes: tuple[Part, ...]
    kept: tuple[str, ...] = ()
    erased: tuple[Part, ...] = ()
    reason: str = ""
    erase_all: bool = False


def parse_table(raw: bytes) -> tuple[Partition, ...]:
    """The partitions of a table; none if it is not a table or is damaged."""
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
                # Wrong offsets would have foreign bytes kept as our data.
                return ()
        # The digest, or erased flash: no entry follows.
        break
    return tuple(found)


def read_image(path: Path) -> Image:
    """Split a merged image into its parts.

    Raises:
        FlashFailed: The file does not exist, or is not an image for a supported chip.
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
    # Erased, it selects no slot: the boot loader starts the first one, which the image fills.
    otadata = [
        Part(p.name, p.offset, ERASED * p.size) for p in table if (p.kind, p.subtype) == _OTADATA
    ]
    return Image(
        path,
        board,
        (
            # Without the filling up to the next part: erased flash is 0xff anyway.
            Part("bootloader", start, content[start:TABLE_OFFSET].rstrip(ERASED)),
            Part("partition table", TABLE_OFFSET, content[TABLE_OFFSET:][:TABLE_BYTES]),
            *otadata,
            *applications,
        ),
        table,
    )


def plan_flash(image: Image, chip_table: Sequence[Partition], *, erase_all: bool = False) -> Plan:
    """Plan what writing an image changes on a chip with that partition table.

    A data partition is kept where the chip has one of the same kind at the same offset. The rest of
    it held something else, such as another firmware's code, which must not be read as data.
    """
    if erase_all:
        return Plan(_ordered(image.parts), erase_all=True)
    data = [partition for partition in image.table if partition.holds_data]
    kept = {partition.name: _valid_until(partition, chip_table) for partition in data}
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


def _valid_until(partition: Partition, chip_table: Sequence[Partition]) -> int:
    """Up to which offset the chip holds valid content of a partition."""
    # At the same offset only: NVS, for one, can be read from nowhere but its beginning.
    for on_chip in chip_table:
        same_kind = (on_chip.kind, on_chip.subtype) == (partition.kind, partition.subtype)
        if same_kind and on_chip.offset == partition.offset:
            # The one on the chip may end sooner: what follows it there was never ours.
            return min(on_chip.end, partition.end)
    return partition.offset


def _ordered(parts: Sequence[Part]) -> tuple[Part, ...]:
    return tuple(sorted(parts, key=lambda part: part.offset))


def _bootloader_of(content: bytes) -> tuple[Board, int] | None:
    """The board that an image is for, and the offset of its boot loader."""
    # The chip id alone is no proof: a boot loader of another chip may lie at another offset.
    for offset, boards in _BOOTLOADERS.items():
        header = content[offset : offset + _CHIP_ID_OFFSET + 2]
        chip_id = int.from_bytes(header[_CHIP_ID_OFFSET:], "little")
        if header[:1] == bytes([_IMAGE_MAGIC]) and chip_id in boards:
            return boards[chip_id], offset
    return None


def _application(content: bytes, partition: Partition) -> Part | None:
    """The content of an application partition in an image; None if there is none."""
    code = content[partition.offset : partition.end]
    # A slot that the image leaves empty is erased there, or lies beyond its end.
    if partition.kind != _APPLICATION or code[:1] != bytes([_IMAGE_MAGIC]):
        return None
    return Part(partition.name, partition.offset, code.rstrip(ERASED))
