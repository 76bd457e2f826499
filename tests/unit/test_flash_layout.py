"""What flashing would do, decided from the image's partition table and the chip's."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.esp_chip import ESP32, ESP32C3, ESP32C6, ESP32S3, ChipKind
from support.esp_image import FACTORY_LAYOUT, Row, merged_image, our_layout, table_bytes
from wheelwire.errors import FlashFailed
from wheelwire.tools.flash import Image, parse_table, plan_flash, read_image
from wheelwire_protocol.codes import Chip


def image_of(folder: Path, content: bytes) -> Image:
    path = folder / "image.bin"
    path.write_bytes(content)
    return read_image(path)


@pytest.fixture
def image(tmp_path: Path) -> Image:
    return image_of(tmp_path, merged_image())


@pytest.mark.parametrize(
    ("kind", "chip"), [(ESP32, Chip.ESP32), (ESP32S3, Chip.ESP32S3), (ESP32C6, Chip.ESP32C6)]
)
def test_an_image_tells_its_chip(tmp_path: Path, kind: ChipKind, chip: Chip) -> None:
    image = image_of(tmp_path, merged_image(kind))
    assert image.chip is chip
    assert image.parts[0].offset == kind.bootloader


def test_an_image_is_taken_apart_to_the_byte(tmp_path: Path) -> None:
    content = merged_image()
    parts = {part.name: part for part in image_of(tmp_path, content).parts}
    assert list(parts) == ["bootloader", "partition table", "otadata", "ota_0"]
    assert [part.offset for part in parts.values()] == [0x1000, 0x8000, 0x11000, 0x100000]
    assert parts["otadata"].content == b"\xff" * 0x2000
    for name in ("bootloader", "partition table", "ota_0"):
        part = parts[name]
        assert part.content == content[part.offset : part.end].ljust(len(part.content), b"\xff")
    assert parts["ota_0"].end == len(content)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xe9",
        b"\xff" * 0x9000,
        merged_image(ESP32C3),
        merged_image()[:0x8000],
        merged_image()[:0x100000],
        merged_image()[0x100000:],  # the application alone, which belongs elsewhere
        merged_image().replace(b"\xaa\x50\x01\x02", b"\xaa\x50\x01\x03"),  # a damaged table
    ],
)
def test_any_other_file_is_no_image(tmp_path: Path, content: bytes) -> None:
    with pytest.raises(FlashFailed, match=r"use wheelwire-<board>\.bin from a release"):
        image_of(tmp_path, content)


def test_a_missing_image_is_reported(tmp_path: Path) -> None:
    with pytest.raises(FlashFailed, match="No such file"):
        read_image(tmp_path / "none")


def test_a_chip_of_our_layout_keeps_its_data(image: Image) -> None:
    plan = plan_flash(image, parse_table(table_bytes(our_layout())))
    assert plan.kept == ("nvs", "recorder", "coredump")
    assert plan.erased == ()
    assert [part.name for part in plan.writes] == [
        "bootloader",
        "partition table",
        "otadata",
        "ota_0",
    ]


def test_what_another_layout_left_in_our_data_is_erased(image: Image) -> None:
    plan = plan_flash(image, parse_table(table_bytes(FACTORY_LAYOUT)))
    assert plan.kept == ("nvs",)
    assert [(part.name, part.offset, part.end) for part in plan.erased] == [
        ("nvs", 0xF000, 0x11000),
        ("recorder", 0x20000, 0x70000),
        ("coredump", 0x70000, 0x90000),
    ]
    assert plan.reason == "the chip has another partition table"
    assert all(set(part.content) == {0xFF} for part in plan.erased)
    assert [part.offset for part in plan.writes] == sorted(part.offset for part in plan.writes)


@pytest.mark.parametrize("raw", [b"", b"\xff" * 0xC00, bytes(0xC00), b"\x00\x50" * 0x600])
def test_a_chip_without_a_table_keeps_nothing(image: Image, raw: bytes) -> None:
    plan = plan_flash(image, parse_table(raw))
    assert plan.kept == ()
    assert plan.reason == "the chip has no partition table"
    assert plan.erased[0].offset == 0x9000


def test_a_damaged_table_counts_as_absent() -> None:
    raw = bytearray(table_bytes(our_layout()))
    raw[5] ^= 1
    assert parse_table(bytes(raw)) == ()


@pytest.mark.parametrize(
    ("row", "kept_until"),
    [
        (("nvs", "data", "nvs", 0x9000, 0x5000), 0xE000),
        (("settings", "data", "nvs", 0x9000, 0x10000), 0x11000),  # a longer one, of another name
        (("nvs", "data", "nvs", 0xA000, 0x7000), 0x9000),  # NVS begins elsewhere: not ours
        (("nvs", "data", "coredump", 0x9000, 0x8000), 0x9000),
    ],
)
def test_only_nvs_at_the_same_place_is_kept(image: Image, row: Row, kept_until: int) -> None:
    plan = plan_flash(image, parse_table(table_bytes([row])))
    erased = {part.name: part.offset for part in plan.erased}
    assert erased.get("nvs", 0x11000) == kept_until
    assert ("nvs" in plan.kept) is (kept_until > 0x9000)


def test_erasing_all_keeps_nothing(image: Image) -> None:
    plan = plan_flash(image, parse_table(table_bytes(our_layout())), erase_all=True)
    assert plan.erase_all
    assert (plan.kept, plan.erased) == ((), ())
