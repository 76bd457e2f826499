"""Putting the firmware on a chip, by `python -m esptool`, and asking it afterwards who it is.

esptool is GPL and an extra of its own; it runs as a program, never as a part of this one.
"""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from wheelwire_protocol.codes import Board

from .device import DeviceInfo
from .drivers.serial import SerialDriver
from .errors import FlashFailed, PortUnavailable, WheelwireError
from .ports import list_serial_ports

CHECKOUT_BUILD = Path(__file__).parents[2] / "build"
FLASH_BAUD_RATE = 460_800
PROBE_TIMEOUT_S = 2.0
"""For a firmware that may not be there at all."""
STANDSTILL_TIMEOUT_S = 3.0
RETURN_TIMEOUT_S = 15.0
"""Native USB vanishes as the chip resets, and comes back."""
REOPEN_PERIOD_S = 0.1

# "App Image Format" and "Partition Tables" in ESP-IDF's documentation.
_IMAGE_MAGIC = 0xE9
_CHIP_ID_OFFSET = 12
_BOOTLOADERS = {0x1000: {0: Board.ESP32}, 0: {9: Board.ESP32S3, 13: Board.ESP32C6}}
"""Where a chip's bootloader begins, and the chip ids that its header may hold there."""
_PARTITION_TABLE_OFFSET = 0x8000
_PARTITION_MAGIC = b"\xaa\x50"

_CONNECTED = re.compile(r"Connected to (ESP\S+)")
_PERCENT = re.compile(r"(\d+(?:\.\d+)?)\s*%")
_LAST_LINES = 20


@dataclass(frozen=True)
class Image:
    """A merged image: bootloader, partition table and firmware, written from address 0."""

    path: Path
    board: Board


def read_image(path: Path) -> Image:
    """Look into an image for the chip that it is made for.

    Raises:
        FlashFailed: There is no such file, or it is no image for a chip of ours.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FlashFailed(f"cannot read the image {path}: {error.strerror}") from error
    table = content[_PARTITION_TABLE_OFFSET : _PARTITION_TABLE_OFFSET + len(_PARTITION_MAGIC)]
    for offset, boards in _BOOTLOADERS.items():
        header = content[offset:]
        chip_id = int.from_bytes(header[_CHIP_ID_OFFSET : _CHIP_ID_OFFSET + 2], "little")
        is_image = table == _PARTITION_MAGIC and header[0] == _IMAGE_MAGIC
        if is_image and chip_id in boards:
            return Image(path, boards[chip_id])
    raise FlashFailed(f"{path} is no merged image for a chip of ours: take the one of a release")


def built_image(board: Board, build: Path = CHECKOUT_BUILD) -> Image:
    """The image that this checkout has built for a board.

    Raises:
        FlashFailed: It has built none.
    """
    name = f"wheelwire-{board.name.lower()}.bin"
    path = build / board.name.lower() / name
    if not path.exists():
        raise FlashFailed(
            f"no firmware image for the {board.name}: download a release's {name} "
            f"and name it with --image, or build it to {path}"
        )
    return read_image(path)


def only_likely_port() -> str:
    """The port of the one board that is plugged in.

    Raises:
        FlashFailed: There is none, or more than one.
    """
    likely = [port.device for port in list_serial_ports() if port.likely_esp32]
    if len(likely) != 1:
        found = ", ".join(likely) or "none"
        raise FlashFailed(f"ports that may be a board: {found}; name one with --port")
    return likely[0]


def ensure_stopped(port: str) -> None:
    """Stop a robot whose firmware answers; a port where none answers is as good.

    Raises:
        FlashFailed: Its wheels go on turning.
    """
    try:
        robot = SerialDriver(port, connect_timeout=PROBE_TIMEOUT_S)
    except PortUnavailable:
        raise
    except WheelwireError:
        return  # an empty chip, or another release
    with robot:
        robot.stop()
        end = time.monotonic() + STANDSTILL_TIMEOUT_S
        sample = robot.read()
        while sample.left_mps or sample.right_mps:
            if time.monotonic() > end:
                raise FlashFailed(f"the wheels at {port} still turn: lift or switch the robot off")
            sample = robot.read()


def identify_chip(port: str) -> Board:
    """Ask the chip's boot ROM what it is. Resets the chip.

    Raises:
        FlashFailed: No chip answers, or one that Wheelwire does not run on.
    """
    output = "\n".join(_esptool("--port", port, "chip-id"))
    connected = _CONNECTED.search(output)
    if not connected:
        raise FlashFailed(f"esptool did not tell which chip is at {port}")
    name = connected[1]
    try:
        return Board[name.replace("-", "")]
    except KeyError:
        raise FlashFailed(
            f"the chip at {port} is an {name}; Wheelwire runs on ESP32, ESP32-S3 and ESP32-C6"
        ) from None


def write_image(port: str, image: Image, report: Callable[[float], None]) -> None:
    """Write an image and reset the chip. `report` is told the part written, 0 to 1.

    Raises:
        FlashFailed: Another chip answers than the image is for, or esptool failed.
    """
    arguments = ("--chip", image.board.name.lower(), "--port", port, "--baud", str(FLASH_BAUD_RATE))
    for line in _esptool(*arguments, "write-flash", "0x0", str(image.path)):
        if percent := _PERCENT.search(line):
            report(min(1.0, float(percent[1]) / 100))


def verify(port: str, image: Image) -> DeviceInfo:
    """Shake hands with the new firmware.

    Raises:
        FlashFailed: It says that it runs on another board.
        WheelwireError: It does not answer, as `SerialDriver` says.
    """
    end = time.monotonic() + RETURN_TIMEOUT_S
    while True:
        try:
            with SerialDriver(port) as robot:
                device = robot.info.device
            break
        except PortUnavailable:
            if time.monotonic() > end:
                raise
            time.sleep(REOPEN_PERIOD_S)
    if device.board is not image.board:
        raise FlashFailed(f"written, but the firmware says that it runs on {device.board.name}")
    return device


def _esptool(*arguments: str) -> Iterator[str]:
    """Run esptool; yields what it prints, progress included, as it comes."""
    if importlib.util.find_spec("esptool") is None:
        raise FlashFailed("esptool is not installed: pip install 'wheelwire[flash]'")
    process = subprocess.Popen(
        [sys.executable, "-m", "esptool", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    )
    lines: list[str] = []
    with process:
        if process.stdout:
            for line in _lines(process.stdout):
                lines = [*lines, line][-_LAST_LINES:]
                yield line
    if process.returncode:
        raise FlashFailed(_reason(lines))


def _lines(stream: IO[str]) -> Iterator[str]:
    """Text mode makes line ends of the carriage returns of a progress bar, too."""
    return (line.strip() for line in stream if line.strip())


def _reason(lines: list[str]) -> str:
    """What esptool gives as its reason, else its last line."""
    for line in lines:
        if "error occurred" in line.lower():
            return f"esptool: {line}; hold the board's BOOT button if it does not connect"
    return f"esptool: {lines[-1] if lines else 'ended without a word'}"
