"""The flash layout of boards in the field: data partitions never move, or their data is lost."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[3] / "firmware" / "esp32"
KIB = 1024
LAYOUT = [
    ("nvs", "data", "nvs", 0x9000, 32 * KIB),
    ("otadata", "data", "ota", 0x11000, 8 * KIB),
    ("recorder", "data", "undefined", 0x20000, 320 * KIB),
    ("coredump", "data", "coredump", 0x70000, 128 * KIB),
    ("ota_0", "app", "ota_0", 0x100000, 1536 * KIB),
    ("ota_1", "app", "ota_1", 0x280000, 1536 * KIB),
]


def rows() -> list[tuple[str, str, str, int, int]]:
    lines = (FIRMWARE / "partitions.csv").read_text().splitlines()
    cells = csv.reader(line for line in lines if not line.startswith("#"))
    return [
        (name, kind, subtype, int(offset, 16), int(size, 16))
        for name, kind, subtype, offset, size in ([c.strip() for c in row] for row in cells)
    ]


def test_the_table_is_the_one_that_boards_have() -> None:
    assert rows() == LAYOUT


def test_the_recorder_uses_all_of_its_partition() -> None:
    keeper = (FIRMWARE / "recorder" / "recorder_keeper.hpp").read_text()
    size = re.search(r"static_assert\(kFlashSize == (\d+) \* 1024\);", keeper)
    assert size
    assert ("recorder", int(size[1]) * KIB) in [(name, n) for name, *_, n in rows()]


def test_partitions_do_not_overlap_and_end_with_4_mib() -> None:
    ends = [offset + size for *_, offset, size in rows()]
    starts = [offset for *_, offset, _ in rows()][1:]
    assert all(end <= start for end, start in zip(ends, starts, strict=False))
    assert ends[-1] == 4 * KIB * KIB


def test_applications_begin_on_64_kib() -> None:
    """The MMU maps flash in such pages."""
    assert all(offset % (64 * KIB) == 0 for _, kind, _, offset, _ in rows() if kind == "app")


@pytest.mark.parametrize(
    "option",
    [
        'PARTITION_TABLE_CUSTOM_FILENAME="firmware/esp32/partitions.csv"',
        "ESPTOOLPY_FLASHSIZE_4MB=y",
        "BOOTLOADER_APP_ROLLBACK_ENABLE=y",
        "ESP_COREDUMP_ENABLE_TO_FLASH=y",
        "ESP_COREDUMP_DATA_FORMAT_ELF=y",
        "ESP_COREDUMP_LOGS=n",
    ],
)
def test_the_build_uses_them_in_silence(option: str) -> None:
    assert f"CONFIG_{option}" in (FIRMWARE / "sdkconfig.defaults").read_text().splitlines()
