"""Writing the firmware to a chip with `python -m esptool`, and checking that it answers.

esptool is GPL and comes with an extra: it runs as a separate program and is never imported.
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
"""Short: the chip may hold no firmware at all."""
STANDSTILL_TIMEOUT_S = 3.0
RETURN_TIMEOUT_S = 15.0
"""A native USB port disappears when the chip resets, and comes back."""
REOPEN_PERIOD_S = 0.1

# In the output of esptool 5.
_CONNECTED = re.compile(r"Connected to (ESP\S+)")
_WRITING = re.compile(r"Writing at 0x([0-9a-f]+)")
_KEPT_LINES = 20


def built_image(board: Board, build: Path = CHECKOUT_BUILD) -> Image:
    """The image that was built in this checkout for a board.

    Raises:
        FlashFailed: There is none.
    """
    name = f"wheelwire-{board.name.lower()}.bin"
    path = build / board.name.lower() / name
    if not path.exists():
        raise FlashFailed(
            f"no firmware image for the {board.name}: download {name} from a release and give it "
            f"with --image, or build it as {path}"
        )
    return read_image(path)


def ensure_stopped(port: str) -> None:
    """Stop the robot if its firmware answers; return if it does not.

    Raises:
        FlashFailed: Its wheels keep turning.
    """
    try:
        robot = SerialDriver(port, connect_timeout=PROBE_TIMEOUT_S)
    except PortUnavailable:
        # Not an empty chip: nothing could be written through this port either.
        raise
    except WheelwireError:
        return  # an empty chip or another release
    with robot:
        robot.stop()  # the reset before flashing would only let the wheels coast
        # The acknowledgement means that the stop has begun: the wheels may still turn.
        end = time.monotonic() + STANDSTILL_TIMEOUT_S
        sample = robot.read()
        # Exactly 0: so the firmware reports a wheel that has not ticked for half a second.
        while sample.left_mps or sample.right_mps:
            if time.monotonic() > end:
                raise FlashFailed(
                    f"the wheels of the robot at {port} keep turning: switch off its motor supply, "
                    "then flash again"
                )
            sample = robot.read()


def identify_chip(port: str) -> Board:
    """Ask the boot ROM which chip this is. Resets the chip.

    Raises:
        FlashFailed: No chip answers, or Wheelwire does not support it.
    """
    output = "\n".join(_esptool("--port", port, "chip-id"))
    connected = _CONNECTED.search(output)
    if not connected:
        raise FlashFailed(
            f"esptool could not identify the chip at {port}: hold the board's BOOT button and retry"
        )
    name = connected[1]
    try:
        # esptool writes ESP32-S3 for the board ESP32S3.
        return Board[name.replace("-", "")]
    except KeyError:
        raise FlashFailed(
            f"the chip at {port} is an {name}, which is not supported: use an ESP32, ESP32-S3 or "
            "ESP32-C6"
        ) from None


def read_chip_table(port: str, board: Board) -> tuple[Partition, ...]:
    """The chip's partition table; empty if it has none. Leaves the chip in its boot loader.

    Raises:
        FlashFailed: esptool failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.bin"
        command = ("read-flash", f"{TABLE_OFFSET:#x}", f"{TABLE_BYTES:#x}", str(path))
        # A generator: nothing runs unless its output is read.
        for _ in _esptool(*_chip_at(port, board), "--after", "no-reset", *command):
            pass
        return parse_table(path.read_bytes())


def write_plan(port: str, board: Board, plan: Plan, report: Callable[[float], None]) -> None:
    """Carry out a plan and reset the chip. `report` receives the fraction written, 0 to 1.

    Raises:
        FlashFailed: The chip is not the one that the image is for, or esptool failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["write-flash", *(["--erase-all"] if plan.erase_all else [])]
        for index, part in enumerate(plan.writes):
            path = Path(folder) / f"{index}.bin"
            path.write_bytes(part.content)
            arguments += [f"{part.offset:#x}", str(path)]
        # In one call, which resets the chip at its end: no start finds only some of the parts.
        for line in _esptool(*_chip_at(port, board), "--baud", str(FLASH_BAUD_RATE), *arguments):
            # By the address: esptool's own percentage begins anew with each part.
            if writing := _WRITING.search(line):
                report(_written(plan.writes, int(writing[1], 16)))


def _written(parts: Sequence[Part], address: int) -> float:
    """The fraction of the parts that lies before an address, 0 to 1."""
    sizes = [len(part.content) for part in parts]
    # What lies between two parts is not written, so the address alone is no fraction.
    before = [min(max(address - part.offset, 0), len(part.content)) for part in parts]
    return sum(before) / max(1, sum(sizes))


def _chip_at(port: str, board: Board) -> tuple[str, ...]:
    return "--chip", board.name.lower(), "--port", port


def verify(port: str, board: Board) -> DeviceInfo:
    """Connect to the new firmware.

    Raises:
        FlashFailed: It reports another board.
        WheelwireError: It does not answer; see `SerialDriver`.
    """
    end = time.monotonic() + RETURN_TIMEOUT_S
    while True:
        try:
            with SerialDriver(port) as robot:
                device = robot.info.device
            break
        except PortUnavailable:
            # Only a missing port is waited for: at one that opens, the firmware has to answer.
            if time.monotonic() > end:
                raise
            time.sleep(REOPEN_PERIOD_S)
    if device.board is not board:
        raise FlashFailed(
            f"the firmware was written, but reports the board {device.board.name} in place of "
            f"{board.name}: flash the release's image for the {board.name}"
        )
    return device


def _esptool(*arguments: str) -> Iterator[str]:
    """Run esptool; yields its output line by line, progress included, as it is printed."""
    # Else the process would end with Python's own words about a missing module.
    if importlib.util.find_spec("esptool") is None:
        raise FlashFailed("esptool is not installed: run pip install 'wheelwire[tools]'")
    process = subprocess.Popen(
        [sys.executable, "-m", "esptool", *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        # In one stream: a reason may be printed on either.
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
    )
    lines: list[str] = []
    # The end of the block waits for the process, also when the reader stops in the middle.
    with process:
        if process.stdout:
            for line in _lines(process.stdout):
                lines = [*lines, line][-_KEPT_LINES:]
                yield line
    if process.returncode:
        raise FlashFailed(_reason(lines))


def _lines(stream: IO[str]) -> Iterator[str]:
    """Lines without blank ones. Text mode also splits a progress bar at its carriage returns."""
    return (line.strip() for line in stream if line.strip())


def _reason(lines: list[str]) -> str:
    """The error that esptool printed, else its last line."""
    for line in lines:
        # esptool's own words are "A fatal error occurred: ..."; hints may follow them.
        if "error occurred" in line.lower():
            return f"esptool: {line}; if it does not connect, hold the board's BOOT button"
    return f"esptool: {lines[-1] if lines else 'exited with no output'}"
