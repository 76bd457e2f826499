"""Writing the firmware to a chip with `python -m esptool`, and checking that it answers.

esptool is GPL and comes with an extra: it runs as a separate program and is never imported. The
layout of a chip's flash: "Partition Tables" and "App Image Format" in ESP-IDF's documentation.
"""

from __future__ import annotations

import hashlib
import importlib.util
import re
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from wheelwire_protocol.codes import Chip

from ..drivers.serial import SerialDriver
from ..errors import FlashFailed, PortUnavailable, WheelwireError
from ..link.info import DeviceInfo

CHECKOUT_BUILD = Path(__file__).parents[3] / "build"
FLASH_BAUD_RATE = 460_800
PROBE_TIMEOUT_S = 2.0
"""Short: the chip may hold no firmware at all."""
STANDSTILL_TIMEOUT_S = 3.0
RETURN_TIMEOUT_S = 15.0
"""A native USB port disappears when the chip resets, and comes back."""
REOPEN_PERIOD_S = 0.1

# In the output of esptool 5.
_CONNECTED = re.compile(r"Connected to (ESP\S+)")
_CHIP_TYPE = re.compile(r"Chip type:\s*(\S+)")
_FLASH_SIZE = re.compile(r"Detected flash size: (\d+)([KM]B)")
_BYTES = {"KB": 1 << 10, "MB": 1 << 20}
_WRITING = re.compile(r"Writing at 0x([0-9a-f]+)")
_KEPT_LINES = 20

NEEDED_BYTES = 4 << 20
"""Of flash: where the last partition of an image ends."""

# Where ESP-IDF's tools put the table by default, and the most that it takes up there.
TABLE_OFFSET = 0x8000
TABLE_BYTES = 0xC00
ERASED = b"\xff"

_IMAGE_MAGIC = b"\xe9"
_CHIP_ID_OFFSET = 12
_BOOTLOADERS = {0x1000: {0: Chip.ESP32}, 0: {9: Chip.ESP32S3, 13: Chip.ESP32C6}}
"""Offset of the boot loader, and the chip ids that its header may contain there."""
# Magic, type, subtype, offset, size, label, flags.
_ENTRY = struct.Struct("<2sBBII16sI")
_ENTRY_MAGIC = b"\xaa\x50"
# Marks the checksum instead of an entry: 14 bytes of 0xff follow, then the MD5 of all entries
# before.
_DIGEST_MAGIC = b"\xeb\xeb"
_APPLICATION = 0
# Type and subtype. It selects the application that the boot loader starts.
_OTADATA = (1, 0)


def built_image(chip: Chip, build: Path = CHECKOUT_BUILD) -> Image:
    """This checkout's built image for a chip.

    Raises:
        FlashFailed: No image was built.
    """
    path = _built_path(chip, build)
    if not path.exists():
        raise FlashFailed(
            f"no firmware image for the {chip.name}: download {path.name} from a release and give "
            f"it with --image, or build it as {path}"
        )
    return read_image(path)


def built_chips(build: Path = CHECKOUT_BUILD) -> list[Chip]:
    """The chips for which this checkout has a built image."""
    return [chip for chip in Chip if _built_path(chip, build).exists()]


def _built_path(chip: Chip, build: Path) -> Path:
    return build / chip.name.lower() / f"wheelwire-{chip.name.lower()}.bin"


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


def identify_chip(port: str) -> Chip:
    """Ask the boot ROM which chip this is, and how large its flash. Resets the chip.

    Raises:
        FlashFailed: No chip answers, or Wheelwire does not support it, or its flash is too small.
    """
    output = "\n".join(_esptool("--port", port, "flash-id"))
    connected = _CONNECTED.search(output)
    if not connected:
        raise FlashFailed(
            f"esptool could not identify the chip at {port}: hold the board's BOOT button and retry"
        )
    name = connected[1]
    try:
        # esptool writes ESP32-S3 for ESP32S3.
        chip = Chip[name.replace("-", "")]
    except KeyError:
        raise FlashFailed(
            f"the chip at {port} is an {name}, which is not supported: use an ESP32, ESP32-S3 or "
            "ESP32-C6"
        ) from None
    exact = _CHIP_TYPE.search(output)
    _check_flash_size(port, exact[1] if exact else name, output)
    return chip


def _check_flash_size(port: str, name: str, output: str) -> None:
    """Refuse a module whose flash is known to be too small, before anything is written to it."""
    # A part that esptool does not know is not refused: it reads back what it has written.
    size = _FLASH_SIZE.search(output)
    if size and int(size[1]) * _BYTES[size[2]] < NEEDED_BYTES:
        raise FlashFailed(
            f"the {name} at {port} has {size[1]} {size[2]} of flash, and Wheelwire needs "
            f"{NEEDED_BYTES >> 20} MB: use a module whose name ends in N4 or more, such as "
            "ESP32-WROOM-32E-N4"
        )


def read_chip_table(port: str, chip: Chip) -> tuple[Partition, ...]:
    """The chip's partition table; empty if it has none. Leaves the chip in its boot loader.

    Raises:
        FlashFailed: esptool failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.bin"
        command = ("read-flash", f"{TABLE_OFFSET:#x}", f"{TABLE_BYTES:#x}", str(path))
        # A generator: nothing runs unless its output is read.
        for _ in _esptool(*_chip_at(port, chip), "--after", "no-reset", *command):
            pass
        return parse_table(path.read_bytes())


def write_plan(port: str, chip: Chip, plan: Plan, report: Callable[[float], None]) -> None:
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
        # In one call, which resets the chip at its end, so that the chip never starts with only
        # some of the parts.
        for line in _esptool(*_chip_at(port, chip), "--baud", str(FLASH_BAUD_RATE), *arguments):
            # By the address: esptool's own percentage restarts with each part.
            if writing := _WRITING.search(line):
                report(_written(plan.writes, int(writing[1], 16)))


def _written(parts: Sequence[Part], address: int) -> float:
    """The fraction of the parts that lies before an address, 0 to 1."""
    # What lies between two parts is not written, so the address alone gives no fraction.
    before = [min(max(address - part.offset, 0), len(part.content)) for part in parts]
    return sum(before) / max(1, sum(len(part.content) for part in parts))


def _chip_at(port: str, chip: Chip) -> tuple[str, ...]:
    return "--chip", chip.name.lower(), "--port", port


def verify(port: str, chip: Chip) -> DeviceInfo:
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
            # Wait only for a missing port: once the port opens, the firmware has to answer.
            if time.monotonic() > end:
                raise
            time.sleep(REOPEN_PERIOD_S)
    if device.board is not chip:
        raise FlashFailed(
            f"the firmware was written, but reports the board {device.board.name} in place of "
            f"{chip.name}: flash the release's image for the {chip.name}"
        )
    return device


def _esptool(*arguments: str) -> Iterator[str]:
    """Run esptool; yields its output line by line, progress included, as it is printed."""
    # Otherwise the process would end with Python's message about a missing module.
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
            # Text mode also splits a progress bar at its carriage returns.
            for line in filter(None, map(str.strip, process.stdout)):
                lines = [*lines, line][-_KEPT_LINES:]
                yield line
    if process.returncode:
        raise FlashFailed(_reason(lines))


def _reason(lines: list[str]) -> str:
    """The error that esptool printed, else its last line."""
    for line in lines:
        # esptool's own words are "A fatal error occurred: ..."; hints may follow them.
        if "error occurred" in line.lower():
            return f"esptool: {line}; if it does not connect, hold the board's BOOT button"
    return f"esptool: {lines[-1] if lines else 'exited with no output'}"


# --- the layout of the flash -------------------------------------------------------------------


@dataclass(frozen=True)
class Partition:
    """One entry of a partition table; offset and size in bytes."""

    name: str
    kind: int
    subtype: int
    offset: int
    size: int

    @property
    def end(self) -> int:
        """Offset of the first byte after it."""
        return self.offset + self.size

    @property
    def holds_data(self) -> bool:
        """Whether it holds data of the user or the firmware, rather than a part of the image."""
        # Not the code, nor otadata, which must select the code that is written.
        return self.kind != _APPLICATION and (self.kind, self.subtype) != _OTADATA


@dataclass(frozen=True)
class Part:
    """Bytes and their offset in flash."""

    name: str
    offset: int
    content: bytes

    @property
    def end(self) -> int:
        """Offset of the first byte after it."""
        return self.offset + len(self.content)


@dataclass(frozen=True)
class Image:
    """A merged image, split into the parts to write, and its partition table."""

    path: Path
    chip: Chip
    parts: tuple[Part, ...]
    table: tuple[Partition, ...]


@dataclass(frozen=True)
class Plan:
    """What flashing does to a chip.

    Attributes:
        writes: In order of their offsets. A region is erased by writing 0xff.
        kept: Names of the data partitions whose content stays on the chip.
        erased: The regions of data partitions with foreign content, as parts of 0xff.
        reason: Why they are erased; empty if none is.
        erase_all: The whole flash is erased first.
    """

    writes: tuple[Part, ...]
    kept: tuple[str, ...] = ()
    erased: tuple[Part, ...] = ()
    reason: str = ""
    erase_all: bool = False


def parse_table(raw: bytes) -> tuple[Partition, ...]:
    """The partitions of a table; none if it is not a table or is damaged."""
    found: list[Partition] = []
    for at in range(0, min(len(raw), TABLE_BYTES) - _ENTRY.size + 1, _ENTRY.size):
        magic, kind, subtype, offset, size, name, _ = _ENTRY.unpack_from(raw, at)
        if magic != _ENTRY_MAGIC:  # the digest, or erased flash: no entry follows
            digest = hashlib.md5(raw[:at], usedforsecurity=False).digest()
            if magic == _DIGEST_MAGIC and digest != raw[at + 16 : at + 32]:
                return ()  # wrong offsets would have foreign bytes kept as our data
            break
        label = name.split(b"\0")[0].decode("ascii", "replace")
        found.append(Partition(label, kind, subtype, offset, size))
    return tuple(found)


def read_image(path: Path) -> Image:
    """Split a merged image into its parts.

    Raises:
        FlashFailed: The file does not exist, or is not an image for a supported chip.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FlashFailed(f"cannot read the image {path}: {error.strerror}") from error
    table = parse_table(content[TABLE_OFFSET : TABLE_OFFSET + TABLE_BYTES])
    applications = [
        Part(p.name, p.offset, content[p.offset : p.end].rstrip(ERASED))
        for p in table
        # A slot that the image leaves empty is erased there, or lies beyond its end.
        if p.kind == _APPLICATION and content[p.offset : p.end].startswith(_IMAGE_MAGIC)
    ]
    bootloader = _bootloader_of(content)
    if not applications or bootloader is None:
        raise FlashFailed(
            f"{path} is not a Wheelwire firmware image for a supported chip; "
            "use wheelwire-<board>.bin from a release"
        )
    chip, start = bootloader
    # Erased, it selects no slot: the boot loader starts the first one, which the image fills.
    otadata = [
        Part(p.name, p.offset, ERASED * p.size) for p in table if (p.kind, p.subtype) == _OTADATA
    ]
    return Image(
        path,
        chip,
        (
            # Without the filling up to the next part: erased flash is 0xff anyway.
            Part("bootloader", start, content[start:TABLE_OFFSET].rstrip(ERASED)),
            Part("partition table", TABLE_OFFSET, content[TABLE_OFFSET:][:TABLE_BYTES]),
            *otadata,
            *applications,
        ),
        table,
    )


def plan_flash(image: Image, chip_table: Sequence[Partition], *, erase_all: bool = False) -> Plan:
    """Plan what writing an image changes on a chip with that partition table.

    A data partition stays where the chip has one of the same kind at the same offset. The rest of
    it held something else, such as another firmware's code, which must not be read as data.
    """
    if erase_all:
        return Plan(_ordered(image.parts), erase_all=True)
    data = [partition for partition in image.table if partition.holds_data]
    kept = {partition.name: _valid_until(partition, chip_table) for partition in data}
    erased = [
        Part(p.name, kept[p.name], ERASED * (p.end - kept[p.name]))
        for p in data
        if kept[p.name] < p.end
    ]
    reason = "another partition table" if chip_table else "no partition table"
    return Plan(
        _ordered((*image.parts, *erased)),
        tuple(p.name for p in data if kept[p.name] > p.offset),
        tuple(erased),
        f"the chip has {reason}" if erased else "",
    )


def _valid_until(partition: Partition, chip_table: Sequence[Partition]) -> int:
    """The offset up to which the chip holds valid content of a partition."""
    # Only at the same offset: NVS, for example, can only be read from its beginning.
    for on_chip in chip_table:
        same_kind = (on_chip.kind, on_chip.subtype) == (partition.kind, partition.subtype)
        if same_kind and on_chip.offset == partition.offset:
            # The one on the chip may end sooner: what follows it there was never ours.
            return min(on_chip.end, partition.end)
    return partition.offset


def _ordered(parts: Sequence[Part]) -> tuple[Part, ...]:
    return tuple(sorted(parts, key=lambda part: part.offset))


def _bootloader_of(content: bytes) -> tuple[Chip, int] | None:
    """The chip that an image is for, and the offset of its boot loader."""
    # The chip id alone proves nothing: a boot loader of another chip may lie at another offset.
    for offset, boards in _BOOTLOADERS.items():
        header = content[offset : offset + _CHIP_ID_OFFSET + 2]
        chip_id = int.from_bytes(header[_CHIP_ID_OFFSET:], "little")
        if header.startswith(_IMAGE_MAGIC) and chip_id in boards:
            return boards[chip_id], offset
    return None
