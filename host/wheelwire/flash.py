"""Putting the firmware on a chip, by `python -m esptool`, and asking it afterwards who it is.

esptool is GPL and an extra of its own; it runs as a program, never as a part of this one.
"""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO

from wheelwire_protocol.codes import Board

from .drivers.serial import SerialDriver
from .errors import FlashFailed, PortUnavailable, WheelwireError
from .flash_layout import (
    TABLE_BYTES,
    TABLE_OFFSET,
    Image,
    Part,
    Partition,
    Plan,
    parse_table,
    read_image,
)
from .link.info import DeviceInfo

CHECKOUT_BUILD = Path(__file__).parents[2] / "build"
FLASH_BAUD_RATE = 460_800
PROBE_TIMEOUT_S = 2.0
"""For a firmware that may not be there at all."""
STANDSTILL_TIMEOUT_S = 3.0
RETURN_TIMEOUT_S = 15.0
"""Native USB vanishes as the chip resets, and comes back."""
REOPEN_PERIOD_S = 0.1

_CONNECTED = re.compile(r"Connected to (ESP\S+)")
_WRITING = re.compile(r"Writing at 0x([0-9a-f]+)")
_LAST_LINES = 20


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


def read_chip_table(port: str, board: Board) -> tuple[Partition, ...]:
    """The partition table that is on the chip; empty when it has none. The chip stays stopped.

    Raises:
        FlashFailed: esptool failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.bin"
        command = ("read-flash", f"{TABLE_OFFSET:#x}", f"{TABLE_BYTES:#x}", str(path))
        for _ in _esptool(*_chip_at(port, board), "--after", "no-reset", *command):
            pass
        return parse_table(path.read_bytes())


def write_plan(port: str, board: Board, plan: Plan, report: Callable[[float], None]) -> None:
    """Carry a plan out and reset the chip. `report` is told the part written, 0 to 1.

    Raises:
        FlashFailed: Another chip answers than the image is for, or esptool failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["write-flash", *(["--erase-all"] if plan.erase_all else [])]
        for index, part in enumerate(plan.writes):
            path = Path(folder) / f"{index}.bin"
            path.write_bytes(part.content)
            arguments += [f"{part.offset:#x}", str(path)]
        for line in _esptool(*_chip_at(port, board), "--baud", str(FLASH_BAUD_RATE), *arguments):
            if writing := _WRITING.search(line):
                report(_written(plan.writes, int(writing[1], 16)))


def _written(parts: Sequence[Part], address: int) -> float:
    """How much of the parts lies before an address, 0 to 1."""
    sizes = [len(part.content) for part in parts]
    before = [min(max(address - part.offset, 0), len(part.content)) for part in parts]
    return sum(before) / max(1, sum(sizes))


def _chip_at(port: str, board: Board) -> tuple[str, ...]:
    return "--chip", board.name.lower(), "--port", port


def verify(port: str, board: Board) -> DeviceInfo:
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
    if device.board is not board:
        raise FlashFailed(f"written, but the firmware says that it runs on {device.board.name}")
    return device


def _esptool(*arguments: str) -> Iterator[str]:
    """Run esptool; yields what it prints, progress included, as it comes."""
    if importlib.util.find_spec("esptool") is None:
        raise FlashFailed("esptool is not installed: pip install 'wheelwire[tools]'")
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
    return f"esptool: {lines[-1] if lines else 'exited with no output'}"
