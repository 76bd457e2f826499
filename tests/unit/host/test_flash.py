"""`wheelwire flash` with a stand-in for esptool and a protocol-only device for the chip."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.fake_device import FakeDevice
from support.pty_device import PtyDevice
from wheelwire import errors, flash
from wheelwire.ports import SerialPort
from wheelwire_protocol.codes import Board
from wheelwire_protocol.types import Stop

PATIENCE_S = 60.0
# Prints what the real one prints, as far as we read it.
ESPTOOL = """
import json, os, sys
with open(os.environ["ESPTOOL_CALLS"], "a") as calls:
    print(json.dumps(sys.argv[1:]), file=calls)
chip = os.environ["ESPTOOL_CHIP_NAME"]
if not chip:
    print("A fatal error occurred: Failed to connect: No serial data received.")
    sys.exit(2)
print("Connecting....")
print(f"Connected to {chip} on a port:")
if "write-flash" in sys.argv:
    for percent in (0, 33.3, 100):
        print(f"Writing at 0x0 [=>] {percent:5.1f}%", end="\\r", flush=True)
    print("\\nHash of data verified.")
"""


def image_bytes(bootloader: int, chip_id: int) -> bytes:
    content = bytearray(b"\xff" * 0x9000)
    content[bootloader] = 0xE9
    content[bootloader + 12 : bootloader + 14] = chip_id.to_bytes(2, "little")
    content[0x8000:0x8002] = b"\xaa\x50"
    return bytes(content)


@pytest.fixture
def image(tmp_path: Path) -> Path:
    path = tmp_path / "wheelwire-esp32.bin"
    path.write_bytes(image_bytes(0x1000, 0))
    return path


@pytest.fixture
def device() -> FakeDevice:
    return FakeDevice(board=Board.ESP32, wheel_mps=0.0)


@pytest.fixture
def port(device: FakeDevice, tmp_path: Path) -> Iterator[str]:
    with PtyDevice(tmp_path / "port", device) as pty:
        yield str(pty.path)


class Esptool:
    """A stand-in on the path of child processes."""

    def __init__(self, folder: Path) -> None:
        package = folder / "modules" / "esptool"
        package.mkdir(parents=True)
        (package / "__init__.py").touch()
        (package / "__main__.py").write_text(ESPTOOL)
        self._calls = folder / "calls"
        self.environment = {
            **os.environ,
            "PYTHONPATH": str(package.parent),
            "ESPTOOL_CALLS": str(self._calls),
            "ESPTOOL_CHIP_NAME": "ESP32",
            "COLUMNS": "200",
        }

    @property
    def calls(self) -> list[list[str]]:
        if not self._calls.exists():
            return []
        return [json.loads(line) for line in self._calls.read_text().splitlines()]

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "wheelwire", "flash", *arguments],
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            check=False,
            env=self.environment,
        )


@pytest.fixture
def esptool(tmp_path: Path) -> Esptool:
    return Esptool(tmp_path)


def check_refusal(result: subprocess.CompletedProcess[str], esptool: Esptool, hint: str) -> None:
    """One line that helps, and nothing was written."""
    assert result.returncode == errors.FlashFailed.exit_code, result.stderr
    (line,) = result.stderr.splitlines()
    assert hint in line
    assert not any("write-flash" in call for call in esptool.calls)


def test_flash_stops_writes_and_shakes_hands(
    esptool: Esptool, device: FakeDevice, port: str, image: Path
) -> None:
    result = esptool.run("--port", port, "--image", str(image), "--json")
    assert result.returncode == 0, result.stderr
    assert json.loads(result.stdout)["device"]["board"] == "ESP32"
    identify, write = esptool.calls
    assert identify == ["--port", port, "chip-id"]
    assert write[:4] == ["--chip", "esp32", "--port", port]
    assert write[-3:] == ["write-flash", "0x0", str(image)]
    assert any(isinstance(message, Stop) for message in device.received)


def test_another_chip_than_the_images_is_refused(esptool: Esptool, port: str, image: Path) -> None:
    esptool.environment["ESPTOOL_CHIP_NAME"] = "ESP32-S3"
    check_refusal(esptool.run("--port", port, "--image", str(image)), esptool, "is an ESP32S3")


def test_a_chip_without_the_peripherals_is_refused(
    esptool: Esptool, port: str, image: Path
) -> None:
    esptool.environment["ESPTOOL_CHIP_NAME"] = "ESP32-C3"
    check_refusal(esptool.run("--port", port, "--image", str(image)), esptool, "ESP32-C3")


def test_no_chip_gives_esptools_reason(esptool: Esptool, port: str, image: Path) -> None:
    esptool.environment["ESPTOOL_CHIP_NAME"] = ""
    check_refusal(esptool.run("--port", port, "--image", str(image)), esptool, "No serial data")


def test_wheels_that_turn_are_a_refusal(
    esptool: Esptool, device: FakeDevice, port: str, image: Path
) -> None:
    device.wheel_mps = 0.2
    check_refusal(esptool.run("--port", port, "--image", str(image)), esptool, "still turn")
    assert esptool.calls == []


def test_firmware_of_another_board_is_told(
    esptool: Esptool, device: FakeDevice, port: str, image: Path
) -> None:
    device.board = Board.ESP32C6
    result = esptool.run("--port", port, "--image", str(image))
    assert result.returncode == errors.FlashFailed.exit_code
    assert "runs on ESP32C6" in result.stderr


def test_esptool_that_is_not_installed_is_told(monkeypatch: pytest.MonkeyPatch, port: str) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(errors.FlashFailed, match=r"wheelwire\[flash\]"):
        flash.identify_chip(port)


@pytest.mark.parametrize(
    ("bootloader", "chip_id", "board"),
    [(0x1000, 0, Board.ESP32), (0, 9, Board.ESP32S3), (0, 13, Board.ESP32C6)],
)
def test_an_image_tells_its_chip(
    tmp_path: Path, bootloader: int, chip_id: int, board: Board
) -> None:
    path = tmp_path / "image"
    path.write_bytes(image_bytes(bootloader, chip_id))
    assert flash.read_image(path).board is board


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xe9",
        b"\xff" * 0x9000,
        image_bytes(0, 0),  # the application alone, which belongs elsewhere
        image_bytes(0, 5),  # ESP32-C3
        image_bytes(0x1000, 0)[:0x8000],
    ],
)
def test_anything_else_is_no_image(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "image"
    path.write_bytes(content)
    with pytest.raises(errors.FlashFailed, match="no merged image"):
        flash.read_image(path)


def test_a_missing_image_says_which_to_take(tmp_path: Path) -> None:
    with pytest.raises(errors.FlashFailed, match="No such file"):
        flash.read_image(tmp_path / "none")
    with pytest.raises(errors.FlashFailed, match=r"wheelwire-esp32s3\.bin"):
        flash.built_image(Board.ESP32S3, tmp_path)


def test_the_port_is_chosen_only_when_there_is_no_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(*names: str) -> None:
        ports = [SerialPort(name, None, "", 1, 2, None, True, "", False) for name in names]
        monkeypatch.setattr(flash, "list_serial_ports", lambda: ports)

    found("/dev/ttyUSB0")
    assert flash.only_likely_port() == "/dev/ttyUSB0"
    found("/dev/ttyUSB0", "/dev/ttyACM0")
    with pytest.raises(errors.FlashFailed, match="/dev/ttyUSB0, /dev/ttyACM0; name one"):
        flash.only_likely_port()
    found()
    with pytest.raises(errors.FlashFailed, match="none"):
        flash.only_likely_port()
