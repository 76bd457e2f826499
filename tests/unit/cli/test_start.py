"""`wheelwire start`: which firmware it offers."""

from __future__ import annotations

import io
from pathlib import Path

import pytest

from support.esp_image import merged_image
from wheelwire.cli import start
from wheelwire.tools import flash
from wheelwire_protocol.codes import Chip


def ask(monkeypatch: pytest.MonkeyPatch, typed: str, *built: Chip) -> str:
    monkeypatch.setattr(flash, "built_chips", lambda: list(built))
    monkeypatch.setattr("sys.stdin", io.StringIO(typed))
    return start._ask_image()


def test_without_a_build_it_says_where_firmware_comes_from(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # Neither Enter nor `build` writes what is not there.
    assert ask(monkeypatch, "\nbuild\nskip\n") == "skip"
    said = capsys.readouterr()
    shown = " ".join((said.out + said.err).split())
    assert "download wheelwire-esp32.bin" in shown
    assert "`pio run -e esp32 -t upload`" in shown
    assert "cannot read the image build" in shown
    assert "`build`" not in shown


def test_a_build_is_offered_for_its_chip(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ask(monkeypatch, "\n", Chip.ESP32S3) == "build"
    assert "`build` (this checkout's, for ESP32S3)" in capsys.readouterr().err


def test_the_image_of_a_release_is_taken(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    image = tmp_path / "wheelwire-esp32.bin"
    image.write_bytes(merged_image(seed=1))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert ask(monkeypatch, "~/wheelwire-esp32.bin\n") == str(image)


def test_only_what_was_built_is_found(tmp_path: Path) -> None:
    assert flash.built_chips(tmp_path) == []
    file = tmp_path / "esp32c6" / "wheelwire-esp32c6.bin"
    file.parent.mkdir()
    file.touch()
    assert flash.built_chips(tmp_path) == [Chip.ESP32C6]
