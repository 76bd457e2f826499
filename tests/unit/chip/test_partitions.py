"""The flash layout of boards in the field: data partitions never move, or their data is lost."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from support.esp_image import our_layout

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


def test_the_table_is_the_one_that_boards_have() -> None:
    assert our_layout() == LAYOUT


def test_the_recorder_uses_all_of_its_partition() -> None:
    keeper = (FIRMWARE / "recorder" / "recorder_keeper.hpp").read_text()
    size = re.search(r"static_assert\(kFlashSize == (\d+) \* 1024\);", keeper)
    assert size
    assert ("recorder", int(size[1]) * KIB) in [(name, n) for name, *_, n in LAYOUT]


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
