"""Merged firmware images as ESP-IDF makes them, with applications of a few kilobytes."""

from __future__ import annotations

import csv
import hashlib
import struct
from pathlib import Path
from random import Random

from .esp_chip import ESP32, IMAGE_MAGIC, TABLE_OFFSET, ChipKind

Row = tuple[str, str, str, int, int]
"""Name, type, subtype, offset, size."""

PARTITIONS = Path(__file__).parents[2] / "firmware" / "esp32" / "partitions.csv"
FACTORY_LAYOUT: list[Row] = [
    ("nvs", "data", "nvs", 0x9000, 0x6000),
    ("phy_init", "data", "phy", 0xF000, 0x1000),
    ("factory", "app", "factory", 0x10000, 0x100000),
]
"""ESP-IDF's own default, which a board of another firmware has."""
_TYPES = {"app": 0, "data": 1}
_SUBTYPES = {
    "factory": 0,
    "ota_0": 0x10,
    "ota_1": 0x11,
    "ota": 0,
    "phy": 1,
    "nvs": 2,
    "coredump": 3,
    "undefined": 6,
}


def our_layout() -> list[Row]:
    """The partitions in `partitions.csv`."""
    lines = [line for line in PARTITIONS.read_text().splitlines() if not line.startswith("#")]
    rows = ([cell.strip() for cell in row] for row in csv.reader(lines))
    return [(name, kind, sub, int(at, 16), int(size, 16)) for name, kind, sub, at, size in rows]


def table_bytes(rows: list[Row]) -> bytes:
    """A partition table as stored in flash, with its digest."""
    entries = b"".join(
        struct.pack(
            "<2sBBII16sI", b"\xaa\x50", _TYPES[kind], _SUBTYPES[sub], at, size, name.encode(), 0
        )
        for name, kind, sub, at, size in rows
    )
    digest = hashlib.md5(entries, usedforsecurity=False).digest()
    return (entries + b"\xeb\xeb" + b"\xff" * 14 + digest).ljust(0xC00, b"\xff")


def code(kind: ChipKind, size: int, seed: int) -> bytes:
    """Data with an image's header, in which every byte can be recognised."""
    header = bytearray(Random(seed).randbytes(size))
    header[0] = IMAGE_MAGIC
    header[12:14] = kind.chip_id.to_bytes(2, "little")
    return bytes(header)


def merged_image(
    kind: ChipKind = ESP32, rows: list[Row] | None = None, *, seed: int = 1, app_bytes: int = 9_001
) -> bytes:
    """Bootloader, table and one application, 0xff between them."""
    rows = our_layout() if rows is None else rows
    start = min(at for _, type_name, _, at, _ in rows if type_name == "app")
    content = bytearray(b"\xff" * (start + app_bytes))
    bootloader = code(kind, 5_003, seed + 1)
    content[kind.bootloader : kind.bootloader + len(bootloader)] = bootloader
    content[TABLE_OFFSET : TABLE_OFFSET + 0xC00] = table_bytes(rows)
    content[start:] = code(kind, app_bytes, seed)
    return bytes(content)
