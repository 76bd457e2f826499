"""`wheelwire flash` with the real esptool, against a stand-in for the chip and its flash."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest

from support import command
from support.core_device import CoreDevice
from support.esp_chip import ESP32C3, ESP32S3, OTADATA_ENTRY, EspChip
from support.esp_image import merged_image, our_layout
from support.pty_device import PtyDevice
from wheelwire import errors
from wheelwire.tools import flash
from wheelwire_protocol.codes import Chip
from wheelwire_protocol.types import Stop, WheelState

OTA_1_IS_SELECTED = OTADATA_ENTRY.pack(2, b"\xff" * 20, 2, 0x55F63774)
"""As the bootloader's tools write it: sequence number 2, valid, and the CRC of the number."""


@pytest.fixture
def image(tmp_path: Path) -> Path:
    path = tmp_path / "wheelwire-esp32.bin"
    path.write_bytes(merged_image(seed=1))
    return path


@pytest.fixture
def chip() -> EspChip:
    """A board that runs an earlier release of ours."""
    chip = EspChip(device=CoreDevice(board=Chip.ESP32))
    put(chip, 0, merged_image(seed=2, app_bytes=12_345))
    return chip


@pytest.fixture
def port(chip: EspChip, tmp_path: Path) -> Iterator[str]:
    with PtyDevice(tmp_path / "port", before=chip) as pty:
        yield str(pty.path)


def put(chip: EspChip, offset: int, content: bytes) -> None:
    chip.flash[offset : offset + len(content)] = content


def fill_data(chip: EspChip) -> dict[str, bytes]:
    """Something in every data partition of ours; returns what."""
    held = {}
    for seed, (name, kind, subtype, offset, size) in enumerate(our_layout()):
        if kind == "data" and subtype != "ota":
            held[name] = Random(seed).randbytes(size)
            put(chip, offset, held[name])
    return held


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return command.run("flash", *arguments, COLUMNS="200")


def flashed(port: str, image: Path, *options: str) -> str:
    """What is printed of a success."""
    result = run(port, "--image", str(image), *options)
    assert result.returncode == 0, result.stderr
    return result.stdout


def check_holds(chip: EspChip, image: Path) -> None:
    """The image is in flash to the byte, and boots."""
    content = image.read_bytes()
    for start, end in ((0x1000, 0x8000), (0x8000, 0x8C00), (0x100000, len(content))):
        assert chip.flash[start:end] == content[start:end]
    assert chip.boots()


def check_refusal(result: subprocess.CompletedProcess[str], hint: str) -> None:
    """One line that helps."""
    assert result.returncode == errors.FlashFailed.exit_code, result.stderr
    (line,) = result.stderr.splitlines()
    assert hint in line


def test_saved_data_survives_flashing(chip: EspChip, port: str, image: Path) -> None:
    held = fill_data(chip)
    put(chip, 0x11000, OTA_1_IS_SELECTED)
    put(chip, 0x280000, b"\xe9 another application")
    assert chip.application() == 0x280000
    said = flashed(port, image)
    assert "keeps the data in: nvs, recorder, coredump" in said
    assert "erases" not in said
    assert "ESP32 240ac4123456" in said
    for name, _, _, offset, size in our_layout():
        if name in held:
            assert chip.flash[offset : offset + size] == held[name], name
    check_holds(chip, image)
    assert chip.application() == 0x100000
    assert chip.device.count(Stop) > 0


def test_erase_leaves_the_image_alone(chip: EspChip, port: str, image: Path) -> None:
    put(chip, 0, Random(3).randbytes(len(chip.flash)))
    assert "erases the whole flash, saved parameters included" in flashed(port, image, "--erase")
    check_holds(chip, image)
    content = image.read_bytes().ljust(len(chip.flash), b"\xff")
    assert chip.flash == content


def test_an_empty_chip_of_another_kind(tmp_path: Path) -> None:
    chip = EspChip(ESP32S3, CoreDevice(board=Chip.ESP32S3))
    image = tmp_path / "wheelwire-esp32s3.bin"
    image.write_bytes(merged_image(ESP32S3))
    with PtyDevice(tmp_path / "port", before=chip) as pty:
        told = json.loads(flashed(str(pty.path), image, "--json"))
    assert told["kept"] == []
    assert told["device"]["board"] == "ESP32S3"
    assert chip.flash == image.read_bytes().ljust(len(chip.flash), b"\xff")


def test_another_chip_than_the_images_is_refused(chip: EspChip, port: str, tmp_path: Path) -> None:
    image = tmp_path / "wheelwire-esp32s3.bin"
    image.write_bytes(merged_image(ESP32S3))
    check_refusal(run(port, "--image", str(image)), "is for the ESP32S3, but the chip at")
    assert chip.erased == []


def test_a_chip_without_the_peripherals_is_refused(tmp_path: Path, image: Path) -> None:
    chip = EspChip(ESP32C3)
    with PtyDevice(tmp_path / "port", before=chip) as pty:
        check_refusal(run(str(pty.path), "--image", str(image)), "is an ESP32-C3")
    assert chip.erased == []


@pytest.mark.parametrize(
    ("flash_id", "told"), [(0x1540EF, "has 2 MB of flash"), (0x1340C8, "has 512 KB of flash")]
)
def test_a_module_with_too_little_flash_is_refused_by_name(
    chip: EspChip, port: str, image: Path, flash_id: int, told: str
) -> None:
    chip.flash_id = flash_id
    before = bytes(chip.flash)
    result = run(port, "--image", str(image))
    check_refusal(result, told)
    assert "the ESP32-D0WDQ6 at" in result.stderr
    assert "needs 4 MB" in result.stderr
    assert chip.erased == []
    assert bytes(chip.flash) == before


@pytest.mark.parametrize("flash_id", [0x1840EF, 0x770000])
def test_a_larger_flash_and_an_unknown_one_are_not_refused(
    chip: EspChip, port: str, image: Path, flash_id: int
) -> None:
    chip.flash_id = flash_id
    flashed(port, image)
    check_holds(chip, image)


def test_an_image_fills_the_flash_that_is_asked_for(image: Path) -> None:
    assert max(p.end for p in flash.read_image(image).table) == flash.NEEDED_BYTES


def test_no_chip_gives_esptools_reason(chip: EspChip, port: str, image: Path) -> None:
    chip.answers_loader = False
    result = run(port, "--image", str(image))
    check_refusal(result, "Failed to connect")
    assert "BOOT button" in result.stderr


def test_wheels_that_turn_are_a_refusal(chip: EspChip, port: str, image: Path) -> None:
    chip.device.edits[WheelState] = {"left_mps": 0.2}
    check_refusal(run("--port", port, "--image", str(image)), "keep turning")
    assert chip.erased == []


def test_firmware_of_another_board_is_reported(chip: EspChip, port: str, image: Path) -> None:
    chip.device.board = Chip.ESP32C6
    check_refusal(run(port, "--image", str(image), "--json"), "reports the board ESP32C6")


def test_missing_esptool_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(errors.FlashFailed, match=r"wheelwire\[tools\]"):
        flash.identify_chip("/dev/null")


def test_a_missing_build_says_which_image_to_take(tmp_path: Path) -> None:
    with pytest.raises(errors.FlashFailed, match=r"wheelwire-esp32s3\.bin"):
        flash.built_image(Chip.ESP32S3, tmp_path)
